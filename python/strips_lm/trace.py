"""A completion as people read it: step by step, with what each state adds and removes.

It compares states as the text says them, right or wrong; what is true is for the oracle to say. No torch here.
"""

from __future__ import annotations

from dataclasses import dataclass

from strips_lm import _native


@dataclass(frozen=True, slots=True)
class Step:
    """One step of a text."""

    operator: str
    """Such as `(pick cup)`, in the text's own words."""
    state: tuple[str, ...] | None
    """The atoms of the state after it, such as `on(cup, shelf)`; `None` where the text says none."""
    added: tuple[str, ...]
    """Atoms of the state that the one before lacks, in the text's order."""
    removed: tuple[str, ...]
    """Atoms of the state before that are gone."""


@dataclass(frozen=True, slots=True)
class Trace:
    """A text from the initial state on."""

    goal: tuple[str, ...]
    """The goal's literals, such as `on(cup, shelf)` and `not opened(box)`."""
    initial: tuple[str, ...]
    """The atoms of the initial state."""
    steps: tuple[Step, ...]


def trace(prompt: str, completion: str) -> Trace:
    """Reads a prompt and what follows it, as far as that makes sense."""
    initial = _atoms(segment(prompt, "<INIT>"))
    steps: list[Step] = []
    before = initial
    for (name, arguments), atoms in _native.parse_completions([completion])[0].steps:
        after = before if atoms is None else tuple(map(spell, atoms))
        added = tuple(atom for atom in after if atom not in before)
        removed = tuple(atom for atom in before if atom not in after)
        operator = f"({' '.join([name, *arguments])})"
        steps.append(Step(operator, None if atoms is None else after, added, removed))
        before = after
    return Trace(literals(segment(prompt, "<GOAL>")), initial, tuple(steps))


def spell(atom: tuple[str, list[str]]) -> str:
    """An atom as texts have it: `on(cup, shelf)`."""
    name, arguments = atom
    return f"{name}({', '.join(arguments)})"


def segment(prompt: str, head: str) -> str:
    """What stands between a segment's token and the next one; nothing where there is no such segment."""
    _, _, rest = prompt.partition(f"{head} ")
    return rest.partition(" <")[0].strip()


def literals(text: str) -> tuple[str, ...]:
    """The literals of a goal, which may be negative."""
    parts = text.split("), ")
    return tuple(part if part.endswith(")") else f"{part})" for part in parts if part)


def _atoms(text: str) -> tuple[str, ...]:
    """The atoms of a state."""
    found = _native.parse_completions([f"<ACTION> begin() <STATE> {text} <|endoftext|>"])[0].steps
    return tuple(map(spell, found[0][1] or ())) if found else ()
