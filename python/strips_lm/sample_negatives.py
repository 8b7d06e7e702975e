"""Draws plans from a model for training prompts, and keeps for each prompt the first that the oracle finds wrong.

Texts that do not end, or are not of the format, are left: the head is asked at the end of whole texts. Price: one batch
of samples over the prompts.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from strips_lm import _native
from strips_lm.own_negatives import OwnNegative

if TYPE_CHECKING:
    from collections.abc import Callable

    from strips_lm.evaluate.suites import DataFolder
    from strips_lm.generate import Planner


def sample_negatives(
    planner: Planner, data: DataFolder, limit: int, tick: Callable[[int], None] | None = None
) -> list[OwnNegative]:
    """At most one negative for each of the first `limit` distinct prompts of the training split (0 is all)."""
    items = data.items("train", limit)
    drawn = planner.draw([item.prompt for item in items], tick)
    numbers = [made.prompt for made in drawn.made]
    problems, words = [data.problem(item) for item in items], [data.words(item) for item in items]
    texts = [completion.text for completion in drawn.texts]
    judged = _native.judge(data.domain, [problems[i] for i in numbers], texts, [words[i] for i in numbers])
    found: dict[int, OwnNegative] = {}
    for number, text, judgement in zip(numbers, texts, judged, strict=True):
        verdict = judgement.verdict
        if judgement.finished and not verdict.is_valid and verdict.outcome != "syntax" and number not in found:
            item = items[number]
            found[number] = OwnNegative(item.index, item.prompt, item.words, text, verdict.outcome)
    return [found[number] for number in sorted(found)]
