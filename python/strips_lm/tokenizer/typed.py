"""Canonical words whose slots say what type an object has: `tool#0`, `vessel#1` in place of `o3`, `o5`.

Whether an action may take an object depends on the object's type first of all. In plain canonical words the type stands
once, in `<OBJECTS>`, and a model has to look it up at every mention; here every mention says it. Objects are numbered
within their type in the order of `<OBJECTS>`, which then lists the slots alone. Objects that no `<OBJECTS>` gives a
type keep the plain slots, so that texts without one have the same tokens as in plain canonical words.

Many a published domain has no types, and says with predicates that nothing changes what is what: `(room ?r)`,
`(ball ?b)`. Where a text calls every object an `object`, the slot says the rarest of these that holds of the object,
and where states are told by what changes the initial state does without this atom.

All else is the canonical tokenizer's: this one exchanges words for words, by a table that each prompt gives.
"""

from __future__ import annotations

import copy
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from strips_lm.tokenizer.base import SPECIAL, TokenizerError, read_settings, write_settings
from strips_lm.tokenizer.canonical import CODEC, CanonicalTokenizer, OfWords, word_level

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from strips_lm._native import Domain, Legend
    from strips_lm.config.sections import Layout
    from strips_lm.tokenizer.base import Ids


@dataclass(frozen=True, slots=True)
class TypedLegend:
    """A text's legend in plain canonical words, and which token stands for which of these."""

    plain: Legend
    tokens: NDArray[np.int32]
    """The token of each canonical word, slots included."""
    words: NDArray[np.int32]
    """The canonical word of each token; a slot that is no object's is a word beyond all slots."""
    listed_as: int | None = None
    """The word that `<OBJECTS>` has for the type of every object, where slots say something else."""
    implied: tuple[tuple[int, int, int], ...] = ()
    """Atoms that slots say and the prompt does not: place among the canonical words, predicate and slot, ascending."""

    @property
    def names(self) -> list[str]:
        """The object of each plain slot."""
        return self.plain.names


class TypedTokenizer(OfWords):
    """A `PlanTokenizer` over canonical words with slots by type."""

    def __init__(self, plain: CanonicalTokenizer, type_slots: int, *, by_predicate: bool = True) -> None:
        """Give each canonical word, plain slots included, its id, and `type_slots` slots of each type the next ones.

        With `by_predicate` the predicates of a domain without types that say what an object is count as types.
        """
        self.slotted, self.type_slots, self.by_predicate = plain, type_slots, by_predicate
        self.first_slot, self.first_typed = plain.codec.first_slot, plain.vocab_size
        self.predicates = plain.kind_predicates() if by_predicate else [[] for _ in plain.domains]
        """Of each domain the words of the predicates that count as types, in the domain's order."""
        kinds = list(dict.fromkeys([*plain.type_words(), *(word for words in self.predicates for word in words)]))
        self.words = [
            *plain.words,
            *(f"{plain.words[kind]}#{number}" for kind in kinds for number in range(type_slots)),
        ]
        self.hf = word_level({word: index for index, word in enumerate(self.words)})
        self.blocks = {kind: self.first_typed + block * type_slots for block, kind in enumerate(kinds)}
        """The first slot of each type, by the type's word."""
        self.kinds = np.repeat(np.array(kinds, dtype=np.int32), type_slots)
        """The type's word of each slot by type."""
        self.slots = (*plain.slots, *((first, type_slots) for first in self.blocks.values()))
        self.objects, self.init, self.object = (plain.ids[word] for word in ("<OBJECTS>", "<INIT>", "object"))
        self.same = np.arange(self.vocab_size, dtype=np.int32)

    @classmethod
    def of_data(cls, data: Path, max_slots: int, layout: Layout, type_slots: int) -> TypedTokenizer:
        """The tokenizer of the domain and lexicon of a data set, or of each of a mixture."""
        return cls(CanonicalTokenizer.of_data(data, max_slots, layout), type_slots)

    @classmethod
    def load(cls, folder: str | Path) -> TypedTokenizer:
        """The tokenizer that `save_pretrained` wrote."""
        settings = read_settings(folder)
        by_predicate = bool(settings.get("by_predicate", False))  # Models of before have no such slots.
        return cls(CanonicalTokenizer.load(folder), int(settings["type_slots"]), by_predicate=by_predicate)

    def save_pretrained(self, folder: str | Path) -> None:
        """Writes transformers' files, the codec and our settings."""
        self.hf.save_pretrained(folder)
        (Path(folder) / CODEC).write_text(self.slotted.codec.to_json(), encoding="utf-8")
        sizes = {"max_slots": self.slotted.max_slots, "type_slots": self.type_slots}
        write_settings(folder, {"kind": "typed", **sizes, "by_predicate": self.by_predicate})

    def of_domain(self, domain: Domain) -> Self:
        """The same tokens for texts of one of the domains.

        Raises:
            TokenizerError: the domain is none of them, or has a predicate or an action that the tokenizer lacks.
        """
        one = copy.copy(self)
        one.slotted = self.slotted.of_domain(domain)
        return one

    def spelling(self, most: int) -> None:
        """None: no names are drawn."""
        del most

    def encode_prompts(self, prompts: Sequence[str]) -> tuple[list[Ids], list[Any]]:
        """Token ids and the legend of each prompt."""
        rows, legends = self.slotted.encode_prompts(prompts)
        typed = [self._legend(row, legend) for row, legend in zip(rows, legends, strict=True)]
        return [self._prompt(row, legend) for row, legend in zip(rows, typed, strict=True)], typed

    def encode_records(
        self, prompts: Sequence[str], completions: Sequence[str], words: Sequence[Sequence[str]] | None = None
    ) -> tuple[list[Ids], list[Ids], list[Any]]:
        """Prompt ids, completion ids and legends; a prompt's tokens do not depend on what follows it."""
        first, rest, legends = self.slotted.encode_records(prompts, completions, words)
        typed = [self._legend(row, legend) for row, legend in zip(first, legends, strict=True)]
        asked = [self._prompt(row, legend) for row, legend in zip(first, typed, strict=True)]
        return asked, [legend.tokens[row] for row, legend in zip(rest, typed, strict=True)], typed

    def decode(self, ids: Sequence[Sequence[int]], legends: Sequence[Any]) -> list[str]:
        """The texts of token sequences, as far as they make sense."""
        plain = [self._plain(row, legend) for row, legend in zip(ids, legends, strict=True)]
        return self.slotted.decode(plain, [legend.plain for legend in legends])

    def decode_completions(
        self, prompts: Sequence[Sequence[int]], completions: Sequence[Sequence[int]], legends: Sequence[Any]
    ) -> list[str]:
        """The completions' texts without the space that parts them from their prompts."""
        asked = [self._plain(row, legend) for row, legend in zip(prompts, legends, strict=True)]
        said = [legend.words[list(row)].tolist() for row, legend in zip(completions, legends, strict=True)]
        return self.slotted.decode_completions(asked, said, [legend.plain for legend in legends])

    def say(self, ids: Sequence[int], legend: TypedLegend) -> str:
        """Tokens as people read them: words, and slots by their objects' names, as far as they have one."""
        slots = [int(legend.words[token]) - self.first_slot for token in ids]
        names = legend.names
        return " ".join(names[s] if 0 <= s < len(names) else self.words[i] for s, i in zip(slots, ids, strict=True))

    def _legend(self, prompt: Ids, plain: Legend) -> TypedLegend:
        """The legend of a text whose prompt has these canonical words.

        Raises:
            TokenizerError: there are more objects of a type than slots.
        """
        tokens, words = self.same[: self.first_typed].copy(), self.same.copy()
        listed = self._listed(prompt)
        atoms = self._said(prompt, listed) if all(kind == self.object for _, kind in listed) else []
        said = {slot: predicate for _, predicate, slot in atoms}
        counts: dict[int, int] = {}
        for slot, kind in ((slot, said.get(slot, kind)) for slot, kind in listed):
            first = self.blocks.get(kind)
            if first is None:
                continue
            number = counts[kind] = counts.get(kind, -1) + 1
            if number >= self.type_slots:
                raise TokenizerError(self._too_many([said.get(slot, kind) for slot, kind in listed], kind))
            # The plain slot is no object's now.
            tokens[slot], words[slot] = first + number, slot + self.slotted.max_slots
            words[first + number] = slot
        implied = () if self.slotted.codec.layout == "report" else tuple(sorted(atoms))
        return TypedLegend(plain, tokens, words, self.object if said else None, implied)

    def _too_many(self, kinds: Sequence[int], kind: int) -> str:
        objects = kinds.count(kind)
        hint = f"hint: train with `tokenizer.type_slots` of {objects} or more"
        few = f"and the tokenizer has {self.type_slots} slots of a type"
        return f"a text with {objects} objects of type `{self.words[kind]}`, {few}\n{hint}"

    def _listed(self, prompt: Ids) -> list[tuple[int, int]]:
        """The slots that `<OBJECTS>` lists in canonical words, each with the word after it, its type's."""
        row = self._object_words(prompt)
        return [(word, row[at + 1]) for at, word in enumerate(row[:-1]) if word >= self.first_slot > row[at + 1]]

    def _said(self, prompt: Ids, listed: Sequence[tuple[int, int]]) -> list[tuple[int, int, int]]:
        """The atoms of `<INIT>` that say what listed objects are: place, predicate and slot, one for each slot.

        Of several the rarest predicate, as domains without types say `(locatable x)`, `(truck x)` of one object and
        mean the latter; of equals the last.
        """
        predicates = self.predicates[self.slotted.domain or 0]
        row = [*prompt.tolist(), self.end_id] if predicates else []
        begin = row.index(self.init) + 1 if self.init in row else len(row)
        end = next((at for at in range(begin, len(row)) if row[at] <= len(SPECIAL)), begin)
        atoms = [
            (at, row[at], row[at + 1])
            for at in range(begin, end)
            if row[at] in predicates and row[at + 1] >= self.first_slot > row[at + 2]
        ]
        counts = Counter(predicate for predicate, _ in {atom[1:] for atom in atoms})
        common_first = sorted(atoms, key=lambda atom: (-counts[atom[1]], predicates.index(atom[1])))
        said = {slot: (at, predicate, slot) for at, predicate, slot in common_first}
        return [said[slot] for slot in dict(listed) if slot in said]

    def _object_words(self, row: Sequence[int] | Ids) -> list[int]:
        """What stands between `<OBJECTS>`, with which a prompt goes on after its first token, and the next marker."""
        if len(row) < 2 or int(row[1]) != self.objects:
            return []
        words: list[int] = []
        for word in row[2:].tolist() if isinstance(row, np.ndarray) else row[2:]:
            if word <= len(SPECIAL):
                break
            words.append(word)
        return words

    def _prompt(self, row: Ids, legend: TypedLegend) -> Ids:
        """A prompt's tokens: a slot by type does without the word for the type, and without the atom that says it."""
        said = legend.tokens[row]
        typed = np.flatnonzero(said[: len(self._object_words(row)) + 1] >= self.first_typed)
        spare = [place for at, _, _ in legend.implied for place in (at, at + 1)]
        return np.delete(said, [*(typed + 1).tolist(), *spare]) if len(typed) or spare else said

    def _plain(self, row: Sequence[int], legend: TypedLegend) -> list[int]:
        """The canonical words of a row that begins with a prompt."""
        tokens = [int(token) for token in row]
        length = len(self._object_words(tokens))
        listed: list[int] = []
        for token in tokens[2 : 2 + length]:
            listed.append(int(legend.words[token]))
            if token >= self.first_typed:
                listed.append(
                    int(self.kinds[token - self.first_typed]) if legend.listed_as is None else legend.listed_as
                )
        rest = legend.words[tokens[2 + length :]].tolist() if len(tokens) > 2 + length else []
        plain = [*tokens[:2], *listed, *rest]
        for at, predicate, slot in legend.implied:
            if at <= len(plain):
                plain[at:at] = predicate, slot
        return plain
