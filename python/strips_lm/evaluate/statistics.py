"""Intervals and averages for counts of successes: what a table needs to be trusted. Plain Python, no arrays."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable

Z_95 = 1.959963984540054
"""The normal distribution's 97.5 % point."""


def wilson(successes: int, trials: int, z: float = Z_95) -> tuple[float, float]:
    """The score interval of a share (Wilson 1927); the whole of [0, 1] where nothing was tried.

    >>> low, high = wilson(58, 100)
    >>> round(low, 3), round(high, 3)
    (0.482, 0.672)
    """
    if trials == 0:
        return 0.0, 1.0
    share, spread = successes / trials, z * z / trials
    middle = (share + spread / 2) / (1 + spread)
    half = z * math.sqrt(share * (1 - share) / trials + spread / (4 * trials)) / (1 + spread)
    # Rounding must not put the share itself outside of its interval, as it did for 0 of 50.
    return max(0.0, min(middle - half, share)), min(1.0, max(middle + half, share))


def mean(values: Iterable[float]) -> float | None:
    """The average, or None of nothing."""
    found = list(values)
    return sum(found) / len(found) if found else None


def ratio(part: float, whole: float) -> float | None:
    """`part / whole`, or None where there is no whole."""
    return part / whole if whole else None
