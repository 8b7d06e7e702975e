"""Intervals and averages for counts of successes: what a table needs to be trusted. Plain Python, no arrays."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Hashable, Iterable, Sequence

    from strips_lm.evaluate.results import Score

Z_95 = 1.959963984540054
"""The normal distribution's 97.5 % point."""


def wilson(successes: int, trials: int, worth: float | None = None, z: float = Z_95) -> tuple[float, float]:
    """The score interval of a share (Wilson 1927); the whole of [0, 1] where nothing was tried.

    `worth` is how many independent trials they are worth (`effective`), all of them where it is not given.

    >>> low, high = wilson(58, 100)
    >>> round(low, 3), round(high, 3)
    (0.482, 0.672)
    """
    if trials == 0:
        return 0.0, 1.0
    share, worth = successes / trials, worth or trials
    spread = z * z / worth
    middle = (share + spread / 2) / (1 + spread)
    half = z * math.sqrt(share * (1 - share) / worth + spread / (4 * worth)) / (1 + spread)
    # Rounding must not put the share itself outside of its interval, as it did for 0 of 50.
    return max(0.0, min(middle - half, share)), min(1.0, max(middle + half, share))


def effective(keys: Iterable[Hashable]) -> float:
    """How many independent trials those with these keys are worth, where trials of one key all come out alike.

    (sum m)^2 / sum m^2 over the m trials of each key (Kish 1965): as many as there are keys where all have equally
    many trials, fewer where they have not.

    >>> effective("aabb"), effective("abcd"), round(effective("aaab"), 1)
    (2.0, 4.0, 1.6)
    """
    counts = Counter(keys).values()
    return sum(counts) ** 2 / sum(count * count for count in counts) if counts else 0.0


def mean(values: Iterable[float]) -> float | None:
    """The average, or None of nothing."""
    found = list(values)
    return sum(found) / len(found) if found else None


def ratio(part: float, whole: float) -> float | None:
    """`part / whole`, or None where there is no whole."""
    return part / whole if whole else None


@dataclass(frozen=True, slots=True)
class Gap:
    """How far one way of choosing among samples goes; shares of valid plans."""

    model: str
    suite: str
    choice: str
    """`best-of-8 by head`, …"""
    start: float
    """Of greedy decoding, or of the first sample where greedy was not tried."""
    reached: float
    most: float
    """By the oracle's choice: any of the samples is valid."""

    @property
    def closed(self) -> float | None:
        """The share of the distance that is closed; below 0 where the choice does harm, `None` of no distance."""
        return ratio(self.reached - self.start, self.most - self.start) if self.most > self.start else None


def rerank_gaps(scores: Sequence[Score]) -> list[Gap]:
    """A gap for each way of choosing that is neither the oracle's nor none."""
    by_key = {(s.model, s.suite, s.decode): s for s in scores}
    found = []
    for (model, suite, decode), score in by_key.items():
        kind, _, choice = decode.partition(" by ")
        most = by_key.get((model, suite, f"{kind} by oracle"))
        start = by_key.get((model, suite, "greedy")) or by_key.get((model, suite, f"{kind} by first"))
        if choice not in ("first", "oracle") and most and start:
            found.append(Gap(model, suite, decode, start.share, score.share, most.share))
    return found
