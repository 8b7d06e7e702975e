"""The oracle's own search, for a prompt on which the model came to no plan: a shortest plan, in the prompt's own words.

Whoever uses it says so: what it writes is marked `by_oracle`. Price: the state space as deep as the shortest plan, to
twice that depth at most.
"""

from __future__ import annotations

import time
from dataclasses import replace
from typing import TYPE_CHECKING

from strips_lm._native import LimitError

if TYPE_CHECKING:
    from strips_lm._native import Task
    from strips_lm.decode import Generation
    from strips_lm.guide import OracleGuide

DEEPEST = 256
"""Steps of the longest plan that is looked for."""


class Fallback:
    """Answers for the model, within `seconds` a prompt."""

    def __init__(self, guide: OracleGuide, seconds: float) -> None:
        self.guide, self.seconds = guide, seconds

    def answer(self, made: Generation) -> Generation:
        """The oracle's text in place of a model's, or the model's where there is no plan within the limits."""
        tasks, _ = self.guide.tasks.find([made.prompt])
        plan = shortest(tasks[0], self.seconds)
        tokens = None if plan is None else self._say(made.prompt, plan)
        return made if tokens is None else replace(made, tokens=tokens, finished=True, by_oracle=True)

    def _say(self, prompt: int, plan: tuple[str, ...]) -> list[int] | None:
        """The plan's tokens; `None` where the prompt lacks a word for it."""
        (row,), (tokens,) = self.guide.add([prompt])
        for number, operator in enumerate(plan, 1):
            if self.guide.steps(row) >= number:
                continue
            found = self.guide.write(row, operator)
            if found is None:
                return None
            row, said = found
            tokens = tokens + said
        return tokens if self.guide.has_ended(row) else None


def shortest(task: Task, seconds: float) -> tuple[str, ...] | None:
    """A shortest plan by iterative doubling of the depth; `None` where there is none within the limits."""
    started, depth = time.monotonic(), 4
    while depth <= DEEPEST:
        left = seconds - (time.monotonic() - started)
        try:
            plan = task.plan_set(depth, time_limit=max(left, 1e-3)).shortest()
        except LimitError:
            return None
        if plan is not None:
            return plan
        depth *= 2
    return None
