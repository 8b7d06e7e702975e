"""A generated plan on a terminal: goal, steps with what each changes, verdict; colours where the terminal has them.

Colours go by meaning: green is added or right, red is wrong, dim is removed or beside the point. `NO_COLOR` turns them
off (rich sees to it); the marks `+`, `-` and the words say the same without them.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from rich.console import Console
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

if TYPE_CHECKING:
    from strips_lm._native import Judgement
    from strips_lm.trace import Step, Trace

INDENT = 5
"""Columns before what belongs to a step."""


def show(found: Trace, judgement: Judgement, sentence: str, *, valid: bool, states: bool) -> None:
    """Print the plan; with `states`, each state in full instead of its changes."""
    console = Console(highlight=False)
    console.print(_hanging(Text("goal", style="dim"), ", ".join(found.goal) or "anything", 7))
    console.print(_hanging(Text("start", style="dim"), ", ".join(found.initial) or "nothing holds", 7))
    console.print()
    plan = judgement.plan.splitlines()
    for number, step in enumerate(found.steps, 1):
        operator = plan[number - 1] if number <= len(plan) else step.operator
        console.print(_operator(number, operator, judgement))
        below = _state(step) if states else _changes(step, found.goal)
        console.print(Padding(below, (0, 0, 0, INDENT)))
        if number == judgement.first_wrong_state and number <= judgement.executable_steps:
            console.print(Padding(Text("this state is not the true one", style="yellow"), (0, 0, 0, INDENT)))
    if found.steps:
        console.print()
    style = "bold green" if valid else "bold red"
    console.print(_hanging(Text(_mark(console, valid), style=style), Text(sentence, style=style), 2))


def note(text: str) -> None:
    """Print a line beside the point."""
    Console(highlight=False).print(Text(text, style="dim"))


def _mark(console: Console, valid: bool) -> str:
    if console.options.ascii_only:
        return "ok " if valid else "! "
    return "✓ " if valid else "✗ "


def _hanging(head: Text, body: Text | str, width: int) -> Table:
    """A head and, beside it, lines that stay clear of it."""
    grid = Table.grid(padding=(0, 0))
    grid.add_column(min_width=width)
    grid.add_column(overflow="fold")
    grid.add_row(head, body)
    return grid


def _operator(number: int, operator: str, judgement: Judgement) -> Text:
    """The step's number and operator: red where the plan fails, dim after it."""
    at = judgement.verdict.step
    style = "bold cyan" if at is None or number < at else "bold red" if number == at else "dim"
    return Text.assemble((f"{number:>3}  ", "dim"), (operator, style))


def _changes(step: Step, goal: tuple[str, ...]) -> Text:
    """What the state adds and removes; what the goal asks for stands out."""
    line = Text()
    for sign, atoms, style in (("+", step.added, "green"), ("-", step.removed, "dim")):
        for atom in atoms:
            strong = "bold " if sign == "+" and atom in goal else ""
            line.append(f"{sign} {atom}".replace(" ", "\N{NO-BREAK SPACE}"), style=strong + style).append("  ")
    return line or Text("no state written" if step.state is None else "nothing changes", style="dim")


def _state(step: Step) -> Text:
    """The whole state, new atoms marked."""
    if step.state is None:
        return Text("no state written", style="dim")
    line = Text()
    for number, atom in enumerate(step.state):
        line.append(", " if number else "").append(atom, style="green" if atom in step.added else "")
    return line
