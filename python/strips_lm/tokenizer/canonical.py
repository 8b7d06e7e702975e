"""The canonical rewriting (Rust) and a word for every token of it.

The codec maps a text to words, and a legend that gives the text back. The vocabulary is closed: the special tokens,
every word the codec may write for its domains, and last, in one contiguous block, the object slots, so that training
may renumber them by arithmetic. Only hints that a user's own prompt also has are given to the codec, so that training
and generation see the same tokens.

A mixture's tokenizer knows several domains. Words that they share are one token, although `move` may take two objects
in one and three in another: which it is, the domain says, and so texts are encoded by `of_domain(domain)`.
"""

from __future__ import annotations

import copy
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from tokenizers import AddedToken, Tokenizer, models, pre_tokenizers
from transformers import PreTrainedTokenizerFast

from strips_lm import _native
from strips_lm.folders import data_sets
from strips_lm.tokenizer.base import END, SPECIAL, START, TokenizerError, read_settings, write_settings

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from strips_lm.config.sections import Layout
    from strips_lm.tokenizer.base import Ids

DOMAIN, LEXICON, CODEC = "domain.pddl", "lexicon.toml", "codec.json"
"""The files of a data set that the codec is made of, and the file of a saved tokenizer that holds it."""


Signature = tuple[list[tuple[str, int]], list[tuple[str, int]]]
"""A domain's predicates and its actions, each with its number of parameters, in order."""


class CanonicalTokenizer:
    """A `PlanTokenizer` over the canonical rewriting of a domain, or of several."""

    def __init__(self, codec: _native.CanonicalCodec, max_slots: int) -> None:
        """Give every word of the codec an id, and `max_slots` slots the last ids."""
        self.codec, self.max_slots = codec, max_slots
        self.words = codec.vocabulary(max_slots)
        self.ids = {word: index for index, word in enumerate(self.words)}
        self.slots: tuple[tuple[int, int], ...] = ((codec.first_slot, max_slots),)
        self.hf = word_level(self.ids)
        self.kinds = frozenset(self.type_words() if codec.kinds else ())
        """The words that may stand before a mention of an object."""
        self.domains = _domains(codec)
        self.domain = 0 if len(self.domains) == 1 else None

    @classmethod
    def of_data(cls, data: Path, max_slots: int, layout: Layout, *, kinds: bool = False) -> CanonicalTokenizer:
        """The tokenizer of the domain and lexicon of a data set, or of each of a mixture.

        With `kinds` an object's type stands before each mention of it.
        """
        sources = [_read(folder) for folder in data_sets(data)]
        return cls(_native.CanonicalCodec.of_domains(sources, layout=layout, kinds=kinds), max_slots)

    def type_words(self) -> list[int]:
        """The words of all types of its domains, each once."""
        return list(dict.fromkeys(self._words_of([name for domain in _known(self.codec) for name in domain["types"]])))

    def kind_predicates(self) -> list[list[int]]:
        """Of each of its domains that has no types, the words of the predicates that say what an object is.

        These are the predicates of one argument that no action changes, in the domain's order.
        """
        return [
            self._words_of([p["name"] for p in domain["predicates"] if p["arity"] == 1 and not p["fluent"]])
            if domain["types"] == ["object"]
            else []
            for domain in _known(self.codec)
        ]

    def _words_of(self, names: Sequence[str]) -> list[int]:
        words = [self.codec.word_of(name) for name in names]
        return [word for word in words if word is not None]

    def of_domain(self, domain: _native.Domain) -> Self:
        """The same tokens for texts of one of the domains.

        Raises:
            TokenizerError: there are several, and it is none of them; or there is one, and it lacks a predicate or an
                action of the domain.
        """
        asked = signature(domain)
        if len(self.domains) == 1:
            if any(set(new) - set(known) for new, known in zip(asked, self.domains[0][1], strict=True)):
                raise TokenizerError(self.not_trained_on(domain))
            return self
        number = next((number for number, (_, known) in enumerate(self.domains) if known == asked), None)
        if number is None:
            raise TokenizerError(self.not_trained_on(domain))
        one = copy.copy(self)
        one.domain = number
        return one

    def speaks(self, domain: _native.Domain) -> bool:
        """Whether its texts are of a domain with the same predicates and actions."""
        return self.domain is not None and self.domains[self.domain][1] == signature(domain)

    def not_trained_on(self, domain: _native.Domain) -> str:
        """The complaint about a domain whose words it does not have."""
        known = ", ".join(name for name, _ in self.domains)
        which = "not the same" if len(self.domains) == 1 else "none of theirs"
        return f"the model was trained on `{known}`, and the predicates or actions of `{domain.name}` are {which}"

    @classmethod
    def load(cls, folder: str | Path) -> CanonicalTokenizer:
        """The tokenizer that `save_pretrained` wrote."""
        codec = _native.CanonicalCodec.from_json((Path(folder) / CODEC).read_text(encoding="utf-8"))
        return cls(codec, int(read_settings(folder)["max_slots"]))

    def save_pretrained(self, folder: str | Path) -> None:
        """Writes transformers' files, the codec and our settings."""
        self.hf.save_pretrained(folder)
        (Path(folder) / CODEC).write_text(self.codec.to_json(), encoding="utf-8")
        write_settings(folder, {"kind": "canonical", "max_slots": self.max_slots})

    @property
    def vocab_size(self) -> int:
        """Ids run from 0 to this, exclusive."""
        return len(self.words)

    @property
    def start_id(self) -> int:
        """The token that begins a record."""
        return self.ids[START]

    @property
    def end_id(self) -> int:
        """The token that ends a record, and pads."""
        return self.ids[END]

    @property
    def slotted(self) -> Self:
        """Itself: a model sees the tokens that are stored."""
        return self

    def spelling(self, most: int) -> None:
        """None: no names are drawn."""
        del most

    def encode_prompts(self, prompts: Sequence[str]) -> tuple[list[Ids], list[Any]]:
        """Token ids and the legend of each prompt."""
        rows, _, legends = self._encode(prompts, None)
        return rows, legends

    def encode_records(
        self, prompts: Sequence[str], completions: Sequence[str], words: Sequence[Sequence[str]] | None = None
    ) -> tuple[list[Ids], list[Ids], list[Any]]:
        """Prompt ids, completion ids and legends; a prompt's tokens do not depend on what follows it."""
        texts = [f"{prompt} {completion}" for prompt, completion in zip(prompts, completions, strict=True)]
        rows, cuts, legends = self._encode(texts, words)
        pairs = list(zip(rows, cuts.tolist(), strict=True))
        return [row[:cut] for row, cut in pairs], [row[cut:] for row, cut in pairs], legends

    def decode(self, ids: Sequence[Sequence[int]], legends: Sequence[Any]) -> list[str]:
        """The texts of token sequences, as far as they make sense."""
        rows = [" ".join(self.words[token] for token in row) for row in ids]
        return self.codec.decode(rows, legends)

    def decode_completions(
        self, prompts: Sequence[Sequence[int]], completions: Sequence[Sequence[int]], legends: Sequence[Any]
    ) -> list[str]:
        """The completions' texts without the space that parts them from their prompts."""
        return self.codec.decode_completions([list(map(int, row)) for row in prompts], completions, legends)

    def say(self, ids: Sequence[int], legend: Any) -> str:
        """Tokens as people read them: words, and slots by their objects' names, as far as they have one."""
        first, names = self.codec.first_slot, legend.names
        return " ".join(names[i - first] if 0 <= i - first < len(names) else self.words[i] for i in ids)

    def _encode(
        self, texts: Sequence[str], words: Sequence[Sequence[str]] | None
    ) -> tuple[list[Ids], NDArray[np.int64], list[Any]]:
        """Token ids of each text, where its prompt ends, and its legend."""
        if self.domain is None:
            raise TokenizerError("texts of which of the tokenizer's domains? `of_domain` says")
        ids, offsets, cuts, legends = self.codec.encode_ids(texts, words, domains=[self.domain] * len(texts))
        if len(ids) and int(ids.max()) >= self.vocab_size:
            raise TokenizerError(_too_many_objects(int(ids.max()) + 1 - self.codec.first_slot, self.max_slots))
        return np.split(ids, offsets[1:-1]), cuts, legends


class OfWords:
    """What tokenizers made from the words of a plain canonical one share with it."""

    slotted: CanonicalTokenizer
    """The plain one."""
    words: list[str]
    """Its words with all else, by id."""

    @property
    def vocab_size(self) -> int:
        """Ids run from 0 to this, exclusive."""
        return len(self.words)

    @property
    def start_id(self) -> int:
        """The token that begins a record."""
        return self.slotted.start_id

    @property
    def end_id(self) -> int:
        """The token that ends a record, and pads."""
        return self.slotted.end_id


def signature(domain: _native.Domain) -> Signature:
    """What a domain must share with one that the tokenizer knows."""
    predicates = [(name, len(types)) for name, types in domain.predicates]
    return predicates, [(name, len(types)) for name, types in domain.actions]


def _domains(codec: _native.CanonicalCodec) -> list[tuple[str, Signature]]:
    """Name and signature of each domain that a codec knows."""
    return [
        (d["name"], ([(p["name"], p["arity"]) for p in d["predicates"]], [tuple(action) for action in d["actions"]]))
        for d in _known(codec)
    ]


def _known(codec: _native.CanonicalCodec) -> list[dict[str, Any]]:
    """What a codec knows of each domain: name, types, predicates with what changes them, actions."""
    known: list[dict[str, Any]] = json.loads(codec.to_json())["domains"]
    return known


def _read(folder: Path) -> tuple[_native.Domain, str | None]:
    """A data set's domain and its lexicon, where it has one."""
    domain = _native.Domain.parse((folder / DOMAIN).read_bytes(), file=str(folder / DOMAIN))
    return domain, (folder / LEXICON).read_text(encoding="utf-8") if (folder / LEXICON).is_file() else None


def _too_many_objects(objects: int, max_slots: int) -> str:
    hint = f"hint: train with `tokenizer.max_slots` of {objects} or more"
    return f"a text with {objects} objects, and the tokenizer has {max_slots} slots\n{hint}"


def word_level(ids: dict[str, int]) -> PreTrainedTokenizerFast:
    """A tokenizer of transformers' kind over words parted by white space."""
    tokenizer = Tokenizer(models.WordLevel(ids, unk_token=END))
    tokenizer.pre_tokenizer = pre_tokenizers.WhitespaceSplit()
    fast: Any = PreTrainedTokenizerFast
    hf: PreTrainedTokenizerFast = fast(tokenizer_object=tokenizer, bos_token=START, eos_token=END, pad_token=END)
    extra = [AddedToken(word, special=True, normalized=False) for word in SPECIAL[1:] if word in ids]
    hf.add_special_tokens({"additional_special_tokens": extra})
    return hf
