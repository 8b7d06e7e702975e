"""The oracle as a guide in spelled names: what the automaton of canonical words lets through, piece by piece.

Where the automaton would have an object's slot, the pieces of the object's name are let through one after the other; a
name is taken when no other name that may stand there goes on from it, or when what follows says that it ended. Pieces
that have no alternative are forced, as all else that has none: the names of a state cost no call of the model, and that
of an operator as many as it takes to tell it from the others.
"""

from __future__ import annotations

from itertools import takewhile
from typing import TYPE_CHECKING, Any

import numpy as np

from strips_lm.guide import OracleGuide

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from strips_lm.guide import Tasks
    from strips_lm.tokenizer import SpelledTokenizer


class SpelledGuide(OracleGuide):
    """An `OracleGuide` for a tokenizer that spells names."""

    def __init__(self, tokenizer: SpelledTokenizer, legends: Sequence[Any], tasks: Tasks) -> None:
        """A guide for the prompts that `legends` belong to.

        Raises:
            ConfigError: the tokenizer's texts are of another domain than the tasks.
        """
        super().__init__(tokenizer, legends, tasks)
        self.tokenizer, self.words = tokenizer, tokenizer.words
        self.begun: dict[int, tuple[int, ...]] = {}
        """Of each row the pieces of a name that is not yet taken."""

    def add(self, prompts: Sequence[int]) -> tuple[list[int], list[list[int]]]:
        """Begin a row for each prompt; the rows' numbers, and the tokens forced in each."""
        rows, forced = super().add(prompts)
        self.begun.update(dict.fromkeys(rows, ()))
        return rows, [self._go_on(row, words) for row, words in zip(rows, forced, strict=True)]

    def mask(self, rows: Sequence[int]) -> NDArray[np.bool_]:
        """Which tokens may come next: flags (rows, vocabulary)."""
        flags = np.zeros((len(rows), len(self.words)), dtype=np.bool_)
        for index, (row, allowed) in enumerate(zip(rows, super().mask(rows), strict=True)):
            begun = self.begun[row]
            if not begun:
                flags[index, : self.first_slot] = allowed[: self.first_slot]
            for slot, name in self._candidates(row, allowed):
                if len(name) > len(begun):
                    flags[index, name[len(begun)]] = True
                else:
                    flags[index] |= self._after(row, slot)
        return flags

    def advance(self, rows: Sequence[int], tokens: Sequence[int]) -> list[list[int]]:
        """Take the token chosen in each row; the tokens forced after it.

        Raises:
            ValueError: a token is not allowed where it comes; its row stays where it is.
        """
        return [self._take(row, token) for row, token in zip(rows, tokens, strict=True)]

    def backtrack(self, row: int) -> tuple[int, list[int]] | None:
        """Take back steps of a row to the last state from which one leads to a state that was never there.

        The steps left, and the tokens forced after them; `None` where the row has ended, or nothing is left to try.
        """
        found = super().backtrack(row)
        if found is None:
            return None
        self.begun[row] = ()
        return found[0], self._go_on(row, found[1])

    def shortened(self, row: int) -> list[int] | None:
        """The tokens of the shortest plan through states that a row, which has ended, came to.

        `None` where its own plan is that short, or it has not ended.
        """
        words = super().shortened(row)
        return None if words is None else self._spell(row, words)

    def fork(self, row: int) -> int:
        """A new row that goes on from where `row` is."""
        new = super().fork(row)
        self.begun[new] = self.begun[row]
        return new

    def remove(self, rows: Sequence[int]) -> None:
        """Forget rows."""
        super().remove(rows)
        for row in rows:
            del self.begun[row]

    def _name(self, row: int, slot: int) -> tuple[int, ...]:
        """The pieces of a slot's name."""
        return tuple(self.tokenizer.spell(self.legends[self.prompts[row]].names[slot]))

    def _spell(self, row: int, words: Sequence[int]) -> list[int]:
        """The tokens of words, names in the place of slots."""
        first = self.first_slot
        return [piece for word in words for piece in (self._name(row, word - first) if word >= first else (word,))]

    def _candidates(self, row: int, allowed: NDArray[np.bool_]) -> list[tuple[int, tuple[int, ...]]]:
        """The slots that may come, with their names, of which the row's begun one is the beginning."""
        begun = self.begun[row]
        slots = np.flatnonzero(allowed[self.first_slot :]).tolist()
        names = [(slot, self._name(row, slot)) for slot in slots]
        return [(slot, name) for slot, name in names if name[: len(begun)] == begun]

    def _after(self, row: int, slot: int) -> NDArray[np.bool_]:
        """Which tokens may come after a slot's name."""
        there = self.fork(row)
        forced = self._commit(there, slot)
        if forced:
            flags = np.zeros(len(self.words), dtype=np.bool_)
            flags[forced[0]] = True
        else:
            flags = self.mask([there])[0]
        self.remove([there])
        return flags

    def _take(self, row: int, token: int) -> list[int]:
        if not self.mask([row])[0][token]:
            raise ValueError(f"token {token} may not come here")
        begun = self.begun[row]
        if begun and (token < self.first_slot or self.tokenizer.begins[token]):
            (allowed,) = super().mask([row])
            forced = self._commit(row, next(slot for slot, name in self._candidates(row, allowed) if name == begun))
            return forced[1:] if forced else self._take(row, token)
        if token < self.first_slot:
            return self._go_on(row, super().advance([row], [token])[0])
        self.begun[row] = (*begun, token)
        return self._go_on(row, [])

    def _commit(self, row: int, slot: int) -> list[int]:
        """Takes a slot, whose name is whole; the tokens forced after it."""
        self.begun[row] = ()
        return self._go_on(row, super().advance([row], [self.first_slot + slot])[0])

    def _go_on(self, row: int, words: Sequence[int]) -> list[int]:
        """The tokens of forced words, and the pieces that are forced after them."""
        spelled = self._spell(row, words)
        (allowed,) = super().mask([row])
        if allowed[: self.first_slot].any() and not self.begun[row]:
            return spelled
        begun, candidates = self.begun[row], self._candidates(row, allowed)
        columns = zip(*(name[len(begun) :] for _, name in candidates), strict=False)
        same = [column[0] for column in takewhile(lambda column: len(set(column)) == 1, columns)]
        self.begun[row] = (*begun, *same)
        if len(candidates) == 1:
            same += self._commit(row, candidates[0][0])
        return [*spelled, *same]
