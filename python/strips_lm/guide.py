"""The oracle as a guide for masked decoding: the automaton of executable plans, for numbered prompts.

It joins the tokenizer's words and the prompts' tasks; what may come next is decided in Rust. Canonical words only;
`spelled_guide` puts names in the place of slots. In the text as it stands an operator is no fixed sequence of tokens.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from strips_lm import _native
from strips_lm.config import ConfigError
from strips_lm.tokenizer import CanonicalTokenizer

if TYPE_CHECKING:
    from collections.abc import Callable, Hashable, Sequence

    from numpy.typing import NDArray

    from strips_lm.tokenizer import PlanTokenizer


_SIGN = re.compile(r"^(toward|away)?[+-]")


@dataclass(frozen=True, slots=True)
class Tasks:
    """The oracle as masked decoding needs it."""

    domain: _native.Domain
    """The domain of all tasks."""
    find: Callable[[Sequence[int]], tuple[list[_native.Task], list[Sequence[str]]]]
    """The tasks of the prompts of these numbers, and each prompt's names of its task's objects."""


class OracleGuide:
    """A `decode.masked.Guide` that lets through what begins an executable plan through states not yet visited."""

    def __init__(self, tokenizer: PlanTokenizer, legends: Sequence[Any], tasks: Tasks) -> None:
        """A guide for the prompts that `legends` belong to.

        Raises:
            ConfigError: the tokenizer is not canonical, or its texts are of another domain than the tasks.
        """
        words = canonical(tokenizer)
        check_domain(words, tasks.domain)
        self.legends, self.tasks, self.layout = legends, tasks, words.codec.layout
        self.words: Sequence[str] = words.words
        self.step, self.state, self.end = words.ids["<ACTION>"], words.ids["<STATE>"], words.end_id
        self.first_slot, self.kinds = words.codec.first_slot, words.kinds
        self.decoder = _native.MaskedDecoder(words.codec, words.words)
        self.prompts: dict[int, int] = {}
        """Of each row the number of its prompt."""

    def add(self, prompts: Sequence[int]) -> tuple[list[int], list[list[int]]]:
        """Begin a row for each prompt; the rows' numbers, and the tokens forced in each."""
        tasks, names = self.tasks.find(prompts)
        first, forced = self.decoder.add(tasks, [self.legends[i] for i in prompts], names)
        rows = list(range(first, first + len(prompts)))
        self.prompts.update(zip(rows, prompts, strict=True))
        return rows, forced

    def mask(self, rows: Sequence[int]) -> NDArray[np.bool_]:
        """Which tokens may come next: flags (rows, vocabulary)."""
        return self.decoder.mask(rows)

    def advance(self, rows: Sequence[int], tokens: Sequence[int]) -> list[list[int]]:
        """Take the token chosen in each row; the tokens forced after it."""
        return self.decoder.advance(rows, tokens)

    def is_open(self, rows: Sequence[int]) -> list[bool]:
        """Of each row whether any token may come."""
        return [status == "open" for status in self.decoder.status(rows)]

    def backtrack(self, row: int) -> tuple[int, list[int]] | None:
        """Take back steps of a row to the last state from which one leads to a state that was never there.

        The steps left, and the tokens forced after them; `None` where the row has ended, or nothing is left to try.
        """
        return self.decoder.backtrack(row)

    def shortened(self, row: int) -> list[int] | None:
        """The tokens of the shortest plan through states that a row, which has ended, came to.

        `None` where its own plan is that short, or it has not ended.
        """
        return self.decoder.shortened(row)

    def has_ended(self, row: int) -> bool:
        """Whether a row's plan has come to its end, and so is valid."""
        return self.decoder.status([row])[0] == "ended"

    def fork(self, row: int) -> int:
        """A new row that goes on from where `row` is."""
        new = self.decoder.fork(row)
        self.prompts[new] = self.prompts[row]
        return new

    def arrive(self, before: Hashable, tokens: Sequence[int]) -> Hashable:
        """The state after `tokens`: the atoms in which it differs from the first state, or all, as the layout has it.

        Where the tokens complete no state, `before` itself.
        """
        found = before if isinstance(before, frozenset) else frozenset()
        for atoms in self._states(tokens):
            spelled = frozenset((_SIGN.sub("", self.words[atom[0]]), *atom[1:]) for atom in atoms)
            found = spelled if self.layout == "report" else found ^ spelled
        return found

    def _states(self, tokens: Sequence[int]) -> list[list[list[int]]]:
        """The atoms of every state in `tokens`, each as its tokens."""
        states: list[list[list[int]]] = []
        inside = False
        for token in tokens:
            if token == self.state:
                states.append([])
            elif inside and token >= self.first_slot:
                states[-1][-1].append(token)
            elif inside and token not in (self.step, self.end) and token not in self.kinds:
                states[-1].append([token])
            inside = token == self.state or (inside and token not in (self.step, self.end))
        return states

    def write(self, row: int, operator: str) -> tuple[int, list[int]] | None:
        """A new row that goes on from `row` by an operator, such as `(pick cup)`, and the tokens; `None` if it cannot.

        Words are tried until the operator stands there, so that nothing need be known of how it is said.
        """
        told = len(self.decoder.plan(row))
        tried: list[tuple[int, list[int]]] = [(row, [])]
        while tried:
            here, tokens = tried.pop()
            for token in np.flatnonzero(self.mask([here])[0]).tolist():
                row = self.fork(here)
                said = [*tokens, token, *self.advance([row], [token])[0]]
                plan = self.decoder.plan(row)
                if len(plan) > told and plan[told] == operator:
                    return row, said
                if len(plan) == told and self.is_open([row])[0]:
                    tried.append((row, said))
        return None

    def steps(self, row: int) -> int:
        """How many operators a row has so far."""
        return len(self.decoder.plan(row))

    def remove(self, rows: Sequence[int]) -> None:
        """Forget rows."""
        self.decoder.remove(rows)
        for row in rows:
            del self.prompts[row]


def canonical(tokenizer: PlanTokenizer) -> CanonicalTokenizer:
    """The canonical words in which the oracle can guide a model: the tokenizer, or what it spells names in.

    Raises:
        ConfigError: it has none.
    """
    words = tokenizer.slotted
    if isinstance(words, CanonicalTokenizer):
        return words
    raise ConfigError(
        "the oracle can guide only a model on canonical words; this one reads the text as it stands\n"
        "hint: train with `--set tokenizer.kind=canonical` or `spelled`"
    )


def check_domain(tokenizer: CanonicalTokenizer, domain: _native.Domain) -> None:
    """Refuse a domain whose operators the tokenizer's words do not say.

    Raises:
        ConfigError: predicates or actions differ from those of the domain that the tokenizer's texts are of.
    """
    if not tokenizer.speaks(domain):
        raise ConfigError(tokenizer.not_trained_on(domain))
