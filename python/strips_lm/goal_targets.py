"""What each atom of a state is to the goal: a target that training shows a model half-way through its depth.

In the report's layout whether a plan is done, and what to do next, hangs on a comparison of the state just written with
the goal, atom by atom, of which the text itself says nothing: one end token a plan, and the first word of each action.
From these alone a model of minutes comes to compare late or not at all (docs/experiments.md). So while it trains, it is
also told the result at every atom (deep supervision, Lee et al. 2015): whether the goal wants the atom, wants it gone,
or does not speak of it. The text and the model stay what they are; nothing of it is left at generation.

This module knows token ids, not models.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

import numpy as np

from strips_lm.tokenizer.canonical import CanonicalTokenizer
from strips_lm.tokenizer.typed import TypedTokenizer

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from strips_lm.tokenizer import PlanTokenizer


@dataclass(frozen=True, slots=True)
class GoalReader:
    """Reads goals and states in the tokens of one tokenizer."""

    goal: int
    init: int
    state: int
    """The tokens before the goal's atoms, the initial state's and each later state's."""
    others: tuple[int, ...]
    """The other tokens that begin or end a section."""
    negation: int
    """The token before an atom that the goal wants gone."""
    strange: tuple[int, ...]
    """Tokens that stand for what is no list of atoms: a record with one of them has no targets."""
    first_slot: int
    """Tokens from here on stand for objects."""

    @classmethod
    def of(cls, tokenizer: PlanTokenizer) -> Self | None:
        """The reader for a tokenizer's texts; None where they do not spell states out, or names take several tokens."""
        words = tokenizer.slotted
        if not (isinstance(tokenizer, CanonicalTokenizer | TypedTokenizer) and isinstance(words, CanonicalTokenizer)):
            return None
        if words.codec.layout != "report":
            return None
        ids = words.ids
        others = (tokenizer.start_id, tokenizer.end_id, *(ids[word] for word in ("<OBJECTS>", "<VOCAB>", "<ACTION>")))
        strange = tuple(ids[word] for word in ("<raw>", "<whole>", "<partial>", "<unknown>"))
        goal, init, state = (ids[word] for word in ("<GOAL>", "<INIT>", "<STATE>"))
        return cls(goal, init, state, others, ids["<not>"], strange, words.codec.first_slot)

    def targets(
        self, rows: Sequence[tuple[NDArray[np.integer], NDArray[np.integer]]]
    ) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
        """The row, the place in it and the target of each atom of the states in (prompt, completion) rows.

        An atom's place is that of its last token. Its target is a token that the layout has anyway: `<GOAL>` if the
        goal wants it, `<not>` if the goal wants it gone, `<STATE>` if the goal does not speak of it. Where the last
        state is the goal to the atom, the goal is read as a whole state, which wants gone whatever it does not name.
        """
        tokens = np.concatenate([part for row in rows for part in row])
        lengths = np.array([len(prompt) + len(completion) for prompt, completion in rows])
        owner = np.repeat(np.arange(len(rows)), lengths)
        section = self._sections(tokens)
        firsts, ends = self._atoms(tokens, section, owner)
        keys = _keys(tokens, owner, firsts, ends)
        owner_of, section_of = owner[firsts], section[firsts]

        of_goal = tokens[section_of] == self.goal
        negated = of_goal & (tokens[firsts - 1] == self.negation)
        wanted = np.isin(keys, keys[of_goal & ~negated])
        unwanted = np.isin(keys, keys[negated])
        states = np.flatnonzero((tokens == self.init) | (tokens == self.state))
        last = np.zeros(len(rows), dtype=np.int64)
        np.maximum.at(last, owner[states], states)
        final = section_of == last[owner_of]
        count = len(rows)
        whole = _distinct(keys, owner_of, of_goal, count) == _distinct(keys, owner_of, of_goal & ~negated, count)
        whole &= _distinct(keys, owner_of, of_goal, count) == _distinct(keys, owner_of, final, count)
        whole &= _distinct(keys, owner_of, final & ~wanted, count) == 0
        found = np.where(wanted, self.goal, np.where(unwanted | whole[owner_of], self.negation, self.state))

        starts = np.cumsum(lengths) - lengths
        return owner_of[~of_goal], (ends - 1 - starts[owner_of])[~of_goal], found[~of_goal]

    def _sections(self, tokens: NDArray[np.integer]) -> NDArray[np.int64]:
        """The place of the mark that each token's section begins with."""
        marks = np.isin(tokens, (self.goal, self.init, self.state, *self.others))
        places: NDArray[np.int64] = np.maximum.accumulate(np.where(marks, np.arange(len(tokens)), 0))
        return places

    def _atoms(
        self, tokens: NDArray[np.integer], section: NDArray[np.int64], owner: NDArray[np.int64]
    ) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Where each atom of a goal or a state begins and ends, of records that have nothing but atoms there."""
        words = np.append(np.flatnonzero(tokens < self.first_slot), len(tokens))
        ends = words[1:]
        words = words[:-1]
        begins = np.isin(tokens[section[words]], (self.goal, self.init, self.state))
        begins &= (section[words] < words) & (tokens[words] != self.negation)
        strange = np.unique(owner[np.isin(tokens, self.strange)])
        begins &= ~np.isin(owner[words], strange)
        return words[begins], ends[begins]


def _keys(
    tokens: NDArray[np.integer], owner: NDArray[np.int64], firsts: NDArray[np.int64], ends: NDArray[np.int64]
) -> NDArray[np.int64]:
    """A number for each atom of each row, the same for the same atom."""
    keys, base = owner[firsts], int(tokens.max()) + 2
    for offset in range(int((ends - firsts).max(initial=0))):
        inside = firsts + offset < ends
        token = np.where(inside, tokens[np.where(inside, firsts + offset, 0)].astype(np.int64) + 1, 0)
        keys = np.unique(keys * base + token, return_inverse=True)[1]
    return keys


def _distinct(
    keys: NDArray[np.int64], owner: NDArray[np.int64], which: NDArray[np.bool_], rows: int
) -> NDArray[np.int64]:
    """How many different atoms each row has of those chosen."""
    firsts = np.unique(keys[which], return_index=True)[1]
    return np.bincount(owner[which][firsts], minlength=rows)
