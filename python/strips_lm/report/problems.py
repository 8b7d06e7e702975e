"""Chosen problems in their state graphs: a model's plan with its probabilities, and the oracle's shortest beside it.

It reads the data set's `domain.pddl` and asks the oracle for the graph and the plan. It runs no model.
"""

from __future__ import annotations

from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

from strips_lm import _native
from strips_lm.evaluate.table import place
from strips_lm.report import graph
from strips_lm.report.figures import free_scores
from strips_lm.report.words import atoms_line, verdict_line
from strips_lm.trace import trace

if TYPE_CHECKING:
    from strips_lm.evaluate.results import Example, Output, Results

MAX_STATES = 260
"""A state graph with more states than this is not drawn."""

LONGEST = 24
"""Steps of the longest plan whose graph is tried."""


def chosen_problems(results: Results, count: int = 3) -> str:
    """A long valid plan, a wrong one, and another valid one from another suite, of the model that is right most often.

    Nothing where the data set's domain is not at hand, or no graph is small enough.
    """
    drawn: list[str] = []
    suites: set[tuple[str, bool]] = set()
    for found, output in _ranked(results):
        kind = (found.suite, output.verdict == "valid")
        if kind in suites or len(drawn) == count:
            continue
        domain = _domain(results, found.suite)
        figure = _figure(domain, found, output) if domain else ""
        if figure:
            drawn.append(figure)
            suites.add(kind)
    return "".join(drawn)


def _domain(results: Results, suite: str) -> _native.Domain | None:
    """The domain of a suite's data set, if it is at hand."""
    path = Path(results.data) / place(suite)[0] / "domain.pddl"
    return _native.Domain.parse(path.read_bytes(), str(path)) if path.is_file() else None


def _ranked(results: Results) -> list[tuple[Example, Output]]:
    """The model's outputs, valid and wrong ones in turn, longer plans first."""
    model = _best_model(results)
    decode = free_scores(results)[0].decode
    found = [(e, o) for e in results.examples for o in e.outputs if (o.model, o.decode) == (model, decode) and o.plan]
    found.sort(key=lambda pair: -len(pair[1].plan.split("\n")))
    valid = [pair for pair in found if pair[1].verdict == "valid"]
    wrong = [pair for pair in found if pair[1].verdict != "valid"]
    turns = max(len(valid), len(wrong))
    return [part[turn] for turn in range(turns) for part in (valid, wrong) if turn < len(part)]


def _best_model(results: Results) -> str:
    """The model with the largest share of valid plans, without help."""
    right: dict[str, int] = {}
    for score in free_scores(results):
        right[score.model] = right.get(score.model, 0) + score.valid
    return max(right, key=lambda name: right[name])


def _figure(domain: _native.Domain, found: Example, output: Output) -> str:
    """The problem's graph and, beside it, both plans; nothing where the graph is too large."""
    task = _native.Task(domain, _native.Problem.parse(found.problem, domain))
    plan = [line.strip() for line in output.plan.splitlines() if line.strip()]
    reference = [line for line in found.reference.splitlines() if line.strip()]
    horizon = min(LONGEST, max(len(reference), len(plan) if output.verdict == "valid" else 0))
    shortest = list(task.plan_set(horizon, max_states=100_000).shortest() or ())
    spelled = _spell(task, horizon)
    if spelled is None:
        return ""
    goal = atoms_line(trace(found.prompt, "").goal)
    beside = (
        f"<h4>{escape(output.model)} <small>{escape(output.decode)}</small></h4>{_steps(output, plan)}"
        f"<p>{verdict_line(output)}</p><h4>The oracle, {len(shortest)} steps</h4>{_oracle(shortest)}"
    )
    drawn = graph.draw(spelled, plan, shortest)
    return (
        f'<div class="problem"><h3>{escape(found.suite)}, prompt {found.index}</h3>'
        f'<p class="faint">Goal: {goal}. {len(spelled.states)} states lie on plans of at most '
        f'{max(spelled.depths)} steps.</p><div class="beside"><figure>{drawn}</figure><div>{beside}</div></div></div>'
    )


def _spell(task: _native.Task, steps: int) -> graph.StateGraph | None:
    """The graph of all plans of one step more than the longer plan has, or of as many as can be drawn."""
    for horizon in (steps + 1, steps):
        try:
            return graph.StateGraph(*_native.state_graph(task, horizon, max_states=MAX_STATES))
        except _native.LimitError:
            continue
    return None


def _steps(output: Output, plan: list[str]) -> str:
    """The model's plan: what cannot be applied is marked, what comes after it is faint."""
    lines = []
    for number, operator in enumerate(plan, 1):
        at = output.step
        kind = "" if at is None or number < at else "wrong" if number == at else "after"
        lines.append(f'<li class="{kind}"><code>{escape(operator)}</code>{_probability(output, number - 1)}</li>')
    return f'<ol class="steps">{"".join(lines)}</ol>'


def _probability(output: Output, index: int) -> str:
    """The step's probability as a bar and a number, and that of its state."""
    if index >= len(output.operator_probabilities):
        return ""
    operator, state = output.operator_probabilities[index], output.state_probabilities[index]
    return (
        f'<span class="likely"><span class="bar"><i style="width:{100 * operator:.1f}%"></i></span>'
        f"<small>{_percent(operator)}; its state {_percent(state)}</small></span>"
    )


def _percent(share: float) -> str:
    return f"{100 * share:.1f} %" if share > 0.001 or share == 0.0 else f"{100 * share:.0e} %"


def _oracle(plan: list[str]) -> str:
    return f'<ol class="steps">{"".join(f"<li><code>{escape(name)}</code></li>" for name in plan)}</ol>'
