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
from typing import TYPE_CHECKING, NamedTuple, Self

import numpy as np

from strips_lm.tokenizer.canonical import CanonicalTokenizer
from strips_lm.tokenizer.typed import TypedTokenizer

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from strips_lm.tokenizer import PlanTokenizer


class GoalTargets(NamedTuple):
    """What a model is told; words are tokens that the layout has anyway."""

    atoms: NDArray[np.int64]
    """The place of the last token of each atom of each state, the initial one included."""
    relations: NDArray[np.int64]
    """`<GOAL>` if the goal wants the atom, `<not>` if it wants the atom gone, `<STATE>` if it does not speak of it."""
    states: NDArray[np.int64]
    """The place of the last token of each state."""
    lacking: NDArray[np.int64]
    """For each of `words`, the number of its state in `states`, ascending."""
    words: NDArray[np.int64]
    """The words of what the goal still lacks after a state, each once: those of the atoms that it wants and has not,
    those of the atoms that it has and wants gone, with `<not>`; the end token where it lacks nothing."""


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
    end: int
    """The token that ends a plan."""

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
        return cls(goal, init, state, others, ids["<not>"], strange, words.codec.first_slot, tokenizer.end_id)

    def targets(self, rows: Sequence[tuple[NDArray[np.integer], NDArray[np.integer]]]) -> GoalTargets:
        """The targets of (prompt, completion) rows, their places counted over the tokens of all rows in order.

        Where a row's last state is the goal to the atom, the goal is read as a whole state, which wants gone whatever
        it does not name.
        """
        tokens = np.concatenate([part for row in rows for part in row]).astype(np.int64)
        owner = np.repeat(np.arange(len(rows)), [len(prompt) + len(completion) for prompt, completion in rows])
        marks = np.isin(tokens, (self.goal, self.init, self.state, *self.others))
        section = np.maximum.accumulate(np.where(marks, np.arange(len(tokens)), 0))
        known = ~np.isin(owner, owner[np.isin(tokens, self.strange)])
        firsts, ends = self._atoms(tokens, section, known)
        keys = _keys(tokens, owner, firsts, ends)
        atoms = _Atoms(tokens, firsts, ends, keys, tokens[section[firsts]] == self.goal)

        states = np.flatnonzero(((tokens == self.init) | (tokens == self.state)) & known)
        number = np.searchsorted(states, section[firsts[~atoms.of_goal]])
        holds = np.zeros((len(states), atoms.distinct), dtype=np.bool_)
        holds[number, keys[~atoms.of_goal]] = True
        wants = np.zeros(atoms.distinct, dtype=np.bool_)
        gone = wants.copy()
        negated = atoms.of_goal & (tokens[firsts - 1] == self.negation)
        wants[keys[atoms.of_goal & ~negated]] = True
        gone[keys[negated]] = True
        of_row = np.zeros(atoms.distinct, dtype=np.int64)
        of_row[keys] = owner[firsts]
        own = owner[states][:, None] == of_row
        last = np.append(owner[states][1:] != owner[states][:-1], True)[: len(states)]
        same = ~((holds != wants) & own).any(axis=1) & ~(gone & own).any(axis=1)
        gone |= np.isin(of_row, owner[states[last & same]]) & ~wants

        target = np.where(wants, self.goal, np.where(gone, self.negation, self.state))[keys]
        lacks = own & np.where(holds, gone, wants)
        lacking, words = self._words(atoms, lacks, gone)
        stops = np.append(np.flatnonzero(marks), len(tokens))
        state_places = stops[np.searchsorted(stops, states, side="right")] - 1
        said = ~atoms.of_goal
        return GoalTargets(ends[said] - 1, target[said], state_places, lacking, words)

    def _atoms(
        self, tokens: NDArray[np.int64], section: NDArray[np.int64], known: NDArray[np.bool_]
    ) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Where each atom of a goal or a state begins and ends, in rows that have nothing but atoms there."""
        words = np.append(np.flatnonzero(tokens < self.first_slot), len(tokens))
        words, ends = words[:-1], words[1:]
        begins = np.isin(tokens[section[words]], (self.goal, self.init, self.state)) & known[words]
        begins &= (section[words] < words) & (tokens[words] != self.negation)
        return words[begins], ends[begins]

    def _words(
        self, atoms: _Atoms, lacks: NDArray[np.bool_], gone: NDArray[np.bool_]
    ) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Each state's number and a word of what it lacks, once; the end token where it lacks nothing."""
        states, keys = np.nonzero(lacks)
        firsts = np.zeros(atoms.distinct, dtype=np.int64)
        lengths = firsts.copy()
        firsts[atoms.keys], lengths[atoms.keys] = atoms.firsts, atoms.ends - atoms.firsts
        counts = lengths[keys]
        within = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
        owners = np.concatenate((np.repeat(states, counts), states[gone[keys]], np.flatnonzero(~lacks.any(axis=1))))
        words = np.full(len(owners), self.end)
        words[: len(within)] = atoms.tokens[np.repeat(firsts[keys], counts) + within]
        words[len(within) : len(within) + int(gone[keys].sum())] = self.negation
        base = int(words.max(initial=0)) + 1
        return np.divmod(np.unique(owners * base + words), base)


class _Atoms(NamedTuple):
    """The atoms of goals and states."""

    tokens: NDArray[np.int64]
    """All tokens."""
    firsts: NDArray[np.int64]
    ends: NDArray[np.int64]
    keys: NDArray[np.int64]
    """A number for each, the same for the same atom of the same row."""
    of_goal: NDArray[np.bool_]

    @property
    def distinct(self) -> int:
        """How many numbers there are."""
        return int(self.keys.max(initial=-1)) + 1


def _keys(
    tokens: NDArray[np.int64], owner: NDArray[np.int64], firsts: NDArray[np.int64], ends: NDArray[np.int64]
) -> NDArray[np.int64]:
    """A number for each atom, the same for the same atom of the same row."""
    keys, base = owner[firsts], int(tokens.max()) + 2
    for offset in range(int((ends - firsts).max(initial=0))):
        inside = firsts + offset < ends
        token = np.where(inside, tokens[np.where(inside, firsts + offset, 0)] + 1, 0)
        keys = np.unique(keys * base + token, return_inverse=True)[1]
    return keys
