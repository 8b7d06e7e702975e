"""How states stand to the goal: what training tells a model on the way through its layers.

In the report's layout whether a plan is done, and what to do next, hangs on a comparison of the state just written with
the goal, atom by atom, of which the text itself says nothing: one end token a plan, and the first words of each action.
From these alone a model of minutes comes to compare late or not at all (docs/experiments.md). So while it trains, it is
also told the results (deep supervision, Lee et al. 2015): at every atom of a state whether the goal wants it, wants it
gone or does not speak of it, and after every state what the goal still lacks. The text and the model stay what they
are; nothing of it is left at generation.

This module knows token ids, not models.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple, Self

import torch

from strips_lm.tokenizer.base import SPECIAL
from strips_lm.tokenizer.canonical import CanonicalTokenizer
from strips_lm.tokenizer.typed import TypedTokenizer

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    import numpy as np
    from numpy.typing import NDArray
    from torch import Tensor

    from strips_lm.tokenizer import PlanTokenizer


class GoalTargets(NamedTuple):
    """What a model is told of the states of some rows; words are tokens that the layout has anyway."""

    atoms: Tensor
    """(atoms,) the place of the last token of each atom of each state, the initial one included."""
    relations: Tensor
    """(atoms,) `<GOAL>` if the goal wants the atom, `<not>` if gone, `<STATE>` if it does not speak of it."""
    states: Tensor
    """(states,) the place of the last token of each state."""
    lacking: Tensor
    """(words,) the number of each word's state in `states`, ascending."""
    words: Tensor
    """(words,) the words of what the goal still lacks after a state, each once: those of the atoms that it wants and
    has not, those of the atoms that it has and wants gone, with `<not>`; the end token where it lacks nothing."""

    def to(self, device: torch.device) -> GoalTargets:
        """The same on another device."""
        return GoalTargets(*(part.to(device) for part in self))


@dataclass(frozen=True, slots=True)
class GoalReader:
    """Reads goals and states in the tokens of one tokenizer."""

    goal: int
    init: int
    state: int
    """The tokens before the goal's atoms, the initial state's and each later state's."""
    marks: frozenset[int]
    """All tokens that begin or end a section, these among them."""
    negation: int
    """The token before an atom that the goal wants gone."""
    strange: frozenset[int]
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
        goal, init, state = (ids[word] for word in ("<GOAL>", "<INIT>", "<STATE>"))
        marks = frozenset(ids[word] for word in SPECIAL) | {tokenizer.end_id}
        strange = frozenset(ids[word] for word in ("<raw>", "<whole>", "<partial>", "<unknown>"))
        return cls(goal, init, state, marks, ids["<not>"], strange, words.codec.first_slot, tokenizer.end_id)

    def targets(self, rows: Sequence[NDArray[np.integer]], starts: Sequence[int]) -> GoalTargets:
        """The targets of records whose first tokens are at the places `starts`.

        Where a record's last state is the goal to the atom, the goal is read as a whole state, which wants gone
        whatever it does not name.
        """
        atoms: list[tuple[int, int]] = []
        states: list[int] = []
        words: list[tuple[int, int]] = []
        for row, start in zip(rows, starts, strict=True):
            for last, relations, lacking in self._told(row.tolist()):
                atoms += [(start + place, relation) for place, relation in relations]
                words += [(len(states), word) for word in lacking]
                states.append(start + last)
        of_atoms, of_states = (torch.tensor(pairs, dtype=torch.long).reshape(-1, 2).T for pairs in (atoms, words))
        return GoalTargets(of_atoms[0], of_atoms[1], torch.tensor(states, dtype=torch.long), of_states[0], of_states[1])

    def _told(self, tokens: list[int]) -> Iterator[tuple[int, list[tuple[int, int]], list[int]]]:
        """Of each state of a row its last place, (place, relation) of its atoms, and the words of what it lacks."""
        if not self.strange.isdisjoint(tokens):
            return
        stops = [*(place for place, token in enumerate(tokens) if token in self.marks), len(tokens)]
        sections = [(tokens[first], first + 1, stop) for first, stop in pairwise(stops)]
        goal = [found for mark, *ends in sections if mark == self.goal for found in self._literals(tokens, *ends)]
        wanted = {atom for atom, positive, _ in goal if positive}
        unwanted = {atom for atom, positive, _ in goal if not positive}
        lists = [
            (stop - 1, [(atom, place) for atom, _, place in self._literals(tokens, first, stop)])
            for mark, first, stop in sections
            if mark in (self.init, self.state)
        ]
        whole = bool(lists) and not unwanted and wanted == {atom for atom, _ in lists[-1][1]}
        for last, listed in lists:
            state = {atom for atom, _ in listed}
            gone = state - wanted if whole else state & unwanted
            atoms = [
                (place, self.goal if atom in wanted else self.negation if atom in gone else self.state)
                for atom, place in listed
            ]
            lacking = {word for atom in (wanted - state) | gone for word in atom}
            yield last, atoms, sorted(lacking | {self.negation} if gone else lacking) or [self.end]

    def _literals(self, tokens: list[int], first: int, stop: int) -> Iterator[tuple[tuple[int, ...], bool, int]]:
        """The atoms of a list, whether each stands there as it is, not negated, and the place of its last token."""
        heads = [p for p in range(first, stop) if tokens[p] < self.first_slot and tokens[p] != self.negation]
        for head, after in pairwise([*heads, stop]):
            end = after - (tokens[after - 1] == self.negation)
            yield tuple(tokens[head:end]), tokens[head - 1] != self.negation, end - 1
