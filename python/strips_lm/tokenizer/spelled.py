"""The canonical rewriting with every object's name spelled: short texts in which names are to be read and copied.

A canonical text has a slot for each object, so that no name reaches the model and unseen ones are no news to it. Here
the pieces of the object's name stand where its slot stood, from a byte-level BPE that is learnt from names alone. All
else is as in canonical words: goal and states as differences, actions and predicates by their names in the domain, and,
where that is asked for, an object's type before each mention of it.

A name's first piece begins with a space, as in GPT-2, so that two names in a row are told apart. Whatever a model
writes as a name is a name of the decoded text, whether or not there is such an object.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from tokenizers import Tokenizer, decoders, models, pre_tokenizers, trainers

from strips_lm import _native
from strips_lm.spelling import Spelling
from strips_lm.tokenizer.base import TokenizerError, write_settings
from strips_lm.tokenizer.canonical import CODEC, CanonicalTokenizer, OfWords, word_level

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from strips_lm._native import Domain
    from strips_lm.config.sections import Layout
    from strips_lm.tokenizer.base import Ids

NAMES = "names.json"
"""The file of a saved tokenizer that holds the BPE over names."""

SPACE = "Ġ"
"""How a byte-level BPE writes a space: the first piece of each name begins with it."""

MOST_SLOTS = 4096
"""Slots that the canonical rewriting may use; none of them is a token."""

MOST_KNOWN = 1 << 16
"""Names whose pieces are kept at hand."""


class SpelledTokenizer(OfWords):
    """A `PlanTokenizer` over canonical words and the pieces of names."""

    slots: tuple[tuple[int, int], ...] = ()

    def __init__(self, words: CanonicalTokenizer, pieces: Tokenizer) -> None:
        """Give each word but the slots its canonical id, and each piece one of the next."""
        self.slotted, self.pieces = words, pieces
        self.first_piece = words.codec.first_slot
        spelled = [piece for piece, _ in sorted(pieces.get_vocab().items(), key=lambda item: item[1])]
        self.words = [*words.words[: self.first_piece], *map(_as_word, spelled)]
        self.begins = [False] * self.first_piece + [piece.startswith(SPACE) for piece in spelled]
        self.hf = word_level({word: index for index, word in enumerate(self.words)})
        self.known: dict[str, list[int]] = {}

    @classmethod
    def of_data(
        cls, data: Path, texts: Iterable[str], vocab_size: int, layout: Layout = "difference", *, kinds: bool = False
    ) -> SpelledTokenizer:
        """The tokenizer of a data set's domain, with pieces learnt from the names in some of its texts.

        Raises:
            TokenizerError: it is a mixture of several domains' data sets.
        """
        words = CanonicalTokenizer.of_data(data, MOST_SLOTS, layout, kinds=kinds)
        if words.domain is None:
            raise TokenizerError("names are spelled in one domain's texts alone\nhint: `tokenizer.kind=canonical`")
        _, legends = words.encode_prompts(list(texts))
        names = (name for legend in legends for name in legend.names)
        return cls(words, learn_pieces(names, vocab_size - words.codec.first_slot))

    @classmethod
    def load(cls, folder: str | Path) -> SpelledTokenizer:
        """The tokenizer that `save_pretrained` wrote."""
        words = CanonicalTokenizer.load(folder)
        return cls(words, Tokenizer.from_file(str(Path(folder) / NAMES)))

    def save_pretrained(self, folder: str | Path) -> None:
        """Writes transformers' files, the codec, the BPE and our settings."""
        self.hf.save_pretrained(folder)
        (Path(folder) / CODEC).write_text(self.slotted.codec.to_json(), encoding="utf-8")
        self.pieces.save(str(Path(folder) / NAMES))
        write_settings(folder, {"kind": "spelled", "max_slots": self.slotted.max_slots})

    def of_domain(self, domain: Domain) -> Self:
        """Itself, where its texts are of that domain.

        Raises:
            TokenizerError: the domain has a predicate or an action that the tokenizer lacks.
        """
        self.slotted.of_domain(domain)
        return self

    def encode_prompts(self, prompts: Sequence[str]) -> tuple[list[Ids], list[Any]]:
        """Token ids and the legend of each prompt."""
        rows, legends = self.slotted.encode_prompts(prompts)
        return self._spell(rows, legends), legends

    def encode_records(
        self, prompts: Sequence[str], completions: Sequence[str], words: Sequence[Sequence[str]] | None = None
    ) -> tuple[list[Ids], list[Ids], list[Any]]:
        """Prompt ids, completion ids and legends; a prompt's tokens do not depend on what follows it."""
        first, rest, legends = self.slotted.encode_records(prompts, completions, words)
        return self._spell(first, legends), self._spell(rest, legends), legends

    def decode(self, ids: Sequence[Sequence[int]], legends: Sequence[Any]) -> list[str]:
        """The texts of token sequences, as far as they make sense."""
        rows = [_Reader(self, legend) for legend in legends]
        read = [reader.read(row) for reader, row in zip(rows, ids, strict=True)]
        return self.slotted.decode(read, [reader.legend() for reader in rows])

    def decode_completions(
        self, prompts: Sequence[Sequence[int]], completions: Sequence[Sequence[int]], legends: Sequence[Any]
    ) -> list[str]:
        """The completions' texts without the space that parts them from their prompts."""
        rows = [_Reader(self, legend) for legend in legends]
        asked = [reader.read(row) for reader, row in zip(rows, prompts, strict=True)]
        said = [reader.read(row) for reader, row in zip(rows, completions, strict=True)]
        return self.slotted.decode_completions(asked, said, [reader.legend() for reader in rows])

    def spelling(self, most: int) -> Spelling:
        """Names of random pieces, for records of at most `most` tokens."""
        ids = np.arange(self.first_piece, self.vocab_size)
        begins = np.array(self.begins[self.first_piece :])
        return Spelling(self.first_piece, ids[begins], ids[~begins], most)

    def say(self, ids: Sequence[int], legend: Any) -> str:
        """Tokens as people read them: words, and names whole."""
        reader = _Reader(self, legend)
        read = reader.read(ids)
        names = {slot: name for name, slot in reader.slots.items()}
        first = self.first_piece
        pairs = zip(read, [*read[1:], 0], strict=True)
        said = [word for word, after in pairs if word not in self.slotted.kinds or after < first]
        return " ".join(names[word - first] if word >= first else self.words[word] for word in said)

    def spell(self, name: str) -> list[int]:
        """The ids of a name's pieces."""
        ids = self.known.get(name)
        if ids is None:
            if len(self.known) >= MOST_KNOWN:
                self.known.clear()
            ids = [self.first_piece + piece for piece in self.pieces.encode(name, add_special_tokens=False).ids]
            self.known[name] = ids
        return ids

    def _spell(self, rows: Sequence[Ids], legends: Sequence[Any]) -> list[Ids]:
        words = [[word] for word in range(self.first_piece)]
        spelled: list[Ids] = []
        for row, legend in zip(rows, legends, strict=True):
            table = words + [self.spell(name) for name in legend.names]
            spelled.append(np.array([piece for word in row.tolist() for piece in table[word]], dtype=np.int32))
        return spelled


class _Reader:
    """Reads rows of one text back as canonical words, in which each name is a slot again."""

    def __init__(self, tokenizer: SpelledTokenizer, legend: _native.Legend) -> None:
        self.tokenizer, self.given = tokenizer, legend
        self.slots = {name: slot for slot, name in reversed(list(enumerate(legend.names)))}
        self.objects = len(legend.names)
        self.names = {tuple(tokenizer.spell(name)): slot for name, slot in self.slots.items()}

    def read(self, row: Sequence[int]) -> list[int]:
        """The canonical words of a row; a name that no object has gets a slot of its own."""
        first, begins = self.tokenizer.first_piece, self.tokenizer.begins
        words: list[int] = []
        name: list[int] = []
        for token in map(int, row):
            if name and (token < first or begins[token]):
                words.append(first + self._slot(name))
                name = []
            if token < first:
                words.append(token)
            else:
                name.append(token)
        return [*words, first + self._slot(name)] if name else words

    def _slot(self, pieces: Sequence[int]) -> int:
        """The slot of a name; pieces that are not how it is split say it as well."""
        slot = self.names.get(tuple(pieces))
        if slot is None:
            tokenizer = self.tokenizer
            text = str(tokenizer.pieces.decode([piece - tokenizer.first_piece for piece in pieces]))
            name = "_".join(text.split()) or "_"
            slot = self.names[tuple(pieces)] = self.slots.setdefault(name, len(self.slots))
        return slot

    def legend(self) -> _native.Legend:
        """The legend, with the names that were read and are no object's."""
        if len(self.slots) == self.objects:
            return self.given
        saved = json.loads(self.given.to_json())
        saved["names"] = [*saved["names"], *list(self.slots)[self.objects :]]
        saved["ranks"] = [*saved["ranks"], *range(len(saved["ranks"]), len(self.slots))] if saved["ranks"] else []
        return _native.Legend.from_json(json.dumps(saved))


def _as_word(piece: str) -> str:
    """How a piece is listed among canonical words; one that goes on with a name must not be taken for one of them."""
    return piece if piece.startswith(SPACE) else f"##{piece}"


def learn_pieces(names: Iterable[str], size: int) -> Tokenizer:
    """A byte-level BPE of `size` pieces over names, each a word by itself; an order of names changes nothing."""
    tokenizer = Tokenizer(models.BPE())
    tokenizer.pre_tokenizer = pre_tokenizers.ByteLevel(add_prefix_space=True, use_regex=False)
    tokenizer.decoder = decoders.ByteLevel()
    alphabet = pre_tokenizers.ByteLevel.alphabet()
    trainer = trainers.BpeTrainer(vocab_size=size, initial_alphabet=alphabet, show_progress=False)
    tokenizer.train_from_iterator(sorted(names), trainer)
    return tokenizer
