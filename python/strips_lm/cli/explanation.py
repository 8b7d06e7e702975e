"""What `generate --explain` says, as comments of a plan file and as JSON."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Sequence

    from strips_lm._native import Judgement
    from strips_lm.explain import Position, Step

SHOWN = 5e-4
"""Choices less probable than this are not printed unless the oracle allows them."""


def to_json(steps: Sequence[Step], judgement: Judgement) -> list[dict[str, Any]]:
    """Every step with its number, its probabilities and, where something is wrong with it, what."""
    return [
        {"step": number, **asdict(step), "wrong": wrong(number, step, judgement)}
        for number, step in enumerate(steps, 1)
    ]


def show(steps: Sequence[Step], judgement: Judgement) -> None:
    """Print the steps; every line is a comment, so that the whole stays a plan file."""
    for number, step in enumerate(steps, 1):
        print(f";\n; step {number}, {step.words}: probability {_share(step.probability)}")
        for position in step.positions:
            print(f";   {_position(position)}")
        if step.state_probability is not None:
            print(f";   state {_share(step.state_probability)}")
        for line in wrong(number, step, judgement):
            print(f";   wrong: {line}")


def wrong(number: int, step: Step, judgement: Judgement) -> list[str]:
    """Sentences: why the plan fails at this step, and how its state differs from the true one."""
    found = []
    verdict = judgement.verdict
    if verdict.step == number:
        found.append(verdict.reason)
    elif verdict.step is None and not verdict.is_valid and number > judgement.executable_steps:
        found.append(f"{verdict.outcome}: {verdict.reason}")
    if number == judgement.first_wrong_state:
        said = step.state_written or "nothing"
        true = f", and is {step.state_true or 'the same as before'}" if step.state_true is not None else ""
        found.append(f"the state after it is said to be {said}{true}")
    return found


def _position(position: Position) -> str:
    """A token, its probability, what the mask leaves of the rest, and the other tokens that might have come."""
    line = f"{position.word} {_share(position.probability)}{_mark(position.allowed)}"
    others = [c for c in position.choices if c.word != position.word and (c.probability >= SHOWN or c.allowed)]
    if others:
        line += " before " + ", ".join(f"{c.word} {_share(c.probability)}{_mark(c.allowed)}" for c in others)
    if position.removed is not None and position.removed >= SHOWN:
        line += f"; the mask would remove {_share(position.removed)}"
    return line


def _share(probability: float) -> str:
    return f"{probability:.3f}" if probability >= SHOWN else f"{probability:.0e}"


def _mark(allowed: bool | None) -> str:
    return " (not allowed)" if allowed is False else ""
