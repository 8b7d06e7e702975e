"""The oracle as a guide in slots by type: what the automaton of canonical words lets through, word for word."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from strips_lm.guide import OracleGuide

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from strips_lm.guide import Tasks
    from strips_lm.tokenizer.typed import TypedLegend, TypedTokenizer


class TypedGuide(OracleGuide):
    """An `OracleGuide` for a tokenizer with slots by type."""

    def __init__(self, tokenizer: TypedTokenizer, legends: Sequence[TypedLegend], tasks: Tasks) -> None:
        """A guide for the prompts that `legends` belong to.

        Raises:
            ConfigError: the tokenizer's texts are of another domain than the tasks.
        """
        super().__init__(tokenizer, [legend.plain for legend in legends], tasks)
        self.typed, self.words = legends, tokenizer.words

    def add(self, prompts: Sequence[int]) -> tuple[list[int], list[list[int]]]:
        """Begin a row for each prompt; the rows' numbers, and the tokens forced in each."""
        rows, forced = super().add(prompts)
        return rows, [self._tokens(row, words) for row, words in zip(rows, forced, strict=True)]

    def mask(self, rows: Sequence[int]) -> NDArray[np.bool_]:
        """Which tokens may come next: flags (rows, vocabulary)."""
        plain = super().mask(rows)
        flags = np.zeros((len(rows), len(self.words)), dtype=np.bool_)
        for index, row in enumerate(rows):
            flags[index, self._legend(row).tokens] = plain[index]
        return flags

    def advance(self, rows: Sequence[int], tokens: Sequence[int]) -> list[list[int]]:
        """Take the token chosen in each row; the tokens forced after it."""
        words = [int(self._legend(row).words[token]) for row, token in zip(rows, tokens, strict=True)]
        forced = super().advance(rows, words)
        return [self._tokens(row, said) for row, said in zip(rows, forced, strict=True)]

    def backtrack(self, row: int) -> tuple[int, list[int]] | None:
        """Take back steps of a row to the last state from which one leads to a state that was never there.

        The steps left, and the tokens forced after them; `None` where the row has ended, or nothing is left to try.
        """
        found = super().backtrack(row)
        return None if found is None else (found[0], self._tokens(row, found[1]))

    def shortened(self, row: int) -> list[int] | None:
        """The tokens of the shortest plan through states that a row, which has ended, came to.

        `None` where its own plan is that short, or it has not ended.
        """
        words = super().shortened(row)
        return None if words is None else self._tokens(row, words)

    def _legend(self, row: int) -> TypedLegend:
        return self.typed[self.prompts[row]]

    def _tokens(self, row: int, words: Sequence[int]) -> list[int]:
        found: list[int] = self._legend(row).tokens[list(words)].tolist()
        return found
