"""Names for slots, drawn anew each time that a record is shown: what makes a model read names instead of knowing them.

A record's tokens have a slot for each object. Here every slot gets a row of random pieces for its name, so that each
piece is met anywhere in a name, no name is met twice, and any name a user has is one more of them. It knows numbers,
no text.

Two things make that quick to learn (docs/experiments.md). Names of one piece come first and longer ones after them,
which saves four tokens in ten. And in half of the records all names are of few pieces, so that names are alike and have
to be told apart.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from strips_lm._native import DataError

if TYPE_CHECKING:
    from collections.abc import Sequence, Sized

    from numpy.typing import NDArray

PIECES = np.cumsum([7, 7, 5, 3, 2, 1, 1, 1]) / 27
"""How often a drawn name has at most 1, 2, … pieces."""

ALIKE_SHARE = 0.5
"""Share of the records whose names are of few pieces."""

FEW = (4, 16)
"""Least and most (exclusive) of these pieces, of either kind."""

MOST_DRAWS = 8
"""Draws in vain after which all further names of a record are a piece longer."""


@dataclass(frozen=True, slots=True)
class Spelling:
    """Draws names for the slots of records."""

    first_slot: int
    """Tokens from here on are slots."""
    begins: NDArray[np.integer]
    """Pieces that a name begins with."""
    others: NDArray[np.integer]
    """Pieces that a name goes on with."""
    most: int
    """Tokens that a record's prompt with a completion may have."""

    def spell(
        self, parts: Sequence[NDArray[np.integer]], rng: np.random.Generator, short_share: float = 0.0
    ) -> list[NDArray[np.integer]]:
        """A prompt and its completions with a name for each slot, the same in all; `short_share` have one piece.

        Where names make it longer than `most`, all have one piece.

        Raises:
            DataError: it is too long, and has more objects than there are pieces to begin a name with.
        """
        rows = [part.tolist() for part in parts]
        count = max(max(row, default=0) for row in rows) + 1 - self.first_slot
        spelled = self._fill(rows, self._names(count, rng, short_share))
        if self.fits(spelled):
            return spelled
        if count > len(self.begins):
            raise DataError(
                f"a record of {count} objects, and {len(self.begins)} pieces to begin names with\n"
                "hint: raise `tokenizer.vocab_size` or `model.context`"
            )
        return self._fill(rows, [(piece,) for piece in rng.permutation(self.begins)[:count].tolist()])

    def fits(self, parts: Sequence[Sized]) -> bool:
        """Whether a prompt with the longest of its completions has at most `most` tokens."""
        return len(parts[0]) + max(map(len, parts[1:]), default=0) <= self.most

    def _names(self, count: int, rng: np.random.Generator, short_share: float) -> list[tuple[int, ...]]:
        """So many names, all different; where that takes many draws they get longer."""
        begins, others = self.begins, self.others
        if rng.random() < ALIKE_SHARE:
            begins, others = (pool[rng.integers(len(pool), size=rng.integers(*FEW))] for pool in (begins, others))
        names: dict[tuple[int, ...], None] = {}
        draws = 0
        while len(names) < count:
            short = rng.random() < short_share
            longer = 0 if short else int(np.searchsorted(PIECES, rng.random(), side="right"))
            longer += (draws - len(names)) // MOST_DRAWS
            first = self.begins if short else begins
            rest = others[rng.integers(len(others), size=longer)]
            names[int(first[rng.integers(len(first))]), *rest.tolist()] = None
            draws += 1
        return list(names)

    def _fill(self, rows: Sequence[Sequence[int]], names: Sequence[tuple[int, ...]]) -> list[NDArray[np.integer]]:
        first = self.first_slot
        tokens = ((names[word - first] if word >= first else (word,) for word in row) for row in rows)
        return [np.array([piece for name in row for piece in name], dtype=np.int64) for row in tokens]
