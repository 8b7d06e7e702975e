"""The canonical rewriting (Rust) and a word for every token of it.

The codec maps a text to words joined by single spaces, and a legend that gives the text back. The vocabulary is
closed: the end token, the other special tokens, every word the codec may write for this domain, and last, in one
contiguous block, the object slots, so that training may renumber them by arithmetic.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from tokenizers import AddedToken, Tokenizer, models, pre_tokenizers
from transformers import PreTrainedTokenizerFast

from strips_lm import _native
from strips_lm.tokenizer.base import END, SPECIAL, START, TokenizerError, read_settings, write_settings

if TYPE_CHECKING:
    from collections.abc import Sequence

    from strips_lm.tokenizer.base import Ids

DOMAIN, LEXICON = "domain.pddl", "lexicon.toml"
"""The files of a data set, and of a saved tokenizer, that the codec is made of."""


class CanonicalTokenizer:
    """A `PlanTokenizer` over the canonical rewriting of one domain."""

    def __init__(self, domain: str, lexicon: str, max_slots: int) -> None:
        """Make the codec of a domain's PDDL text and lexicon, and its vocabulary."""
        self.domain, self.lexicon, self.max_slots = domain, lexicon, max_slots
        self.codec = _native.CanonicalCodec(_native.Domain.parse(domain, file=DOMAIN), lexicon)
        inner = [word for word in self.codec.vocabulary() if word not in (END, *SPECIAL)]
        self.words = [END, *SPECIAL, *inner, *(f"o{slot}" for slot in range(max_slots))]
        self.ids = {word: index for index, word in enumerate(self.words)}
        self.slots = (len(self.words) - max_slots, max_slots)
        self.hf = _word_level(self.ids)

    @classmethod
    def of_data(cls, data: Path, max_slots: int) -> CanonicalTokenizer:
        """The tokenizer of a data set's domain and lexicon."""
        domain, lexicon = ((data / name).read_text(encoding="utf-8") for name in (DOMAIN, LEXICON))
        return cls(domain, lexicon, max_slots)

    @classmethod
    def load(cls, folder: str | Path) -> CanonicalTokenizer:
        """The tokenizer that `save_pretrained` wrote."""
        domain, lexicon = ((Path(folder) / name).read_text(encoding="utf-8") for name in (DOMAIN, LEXICON))
        return cls(domain, lexicon, int(read_settings(folder)["max_slots"]))

    def save_pretrained(self, folder: str | Path) -> None:
        """Writes transformers' files, the domain, the lexicon and our settings."""
        self.hf.save_pretrained(folder)
        (Path(folder) / DOMAIN).write_text(self.domain, encoding="utf-8")
        (Path(folder) / LEXICON).write_text(self.lexicon, encoding="utf-8")
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

    def encode_prompts(self, prompts: Sequence[str]) -> tuple[list[Ids], list[Any]]:
        """Token ids and the legend of each prompt."""
        canonical, legends = self.codec.encode(list(prompts), None)
        return [self._ids(text) for text in canonical], list(legends)

    def encode_records(
        self, prompts: Sequence[str], completions: Sequence[str], words: Sequence[Sequence[str]] | None = None
    ) -> tuple[list[Ids], list[Ids], list[Any]]:
        """Prompt ids, completion ids and legends; the completion starts at the first action or at the end token."""
        texts = [f"{prompt} {completion}" for prompt, completion in zip(prompts, completions, strict=True)]
        canonical, legends = self.codec.encode(texts, None if words is None else [list(row) for row in words])
        rows = [self._ids(text) for text in canonical]
        cuts = [int(np.argmax((row == self.ids["<ACTION>"]) | (row == self.end_id))) for row in rows]
        return (
            [row[:cut] for row, cut in zip(rows, cuts, strict=True)],
            [row[cut:] for row, cut in zip(rows, cuts, strict=True)],
            list(legends),
        )

    def decode(self, ids: Sequence[Sequence[int]], legends: Sequence[Any]) -> list[str]:
        """The texts of token sequences, as far as they make sense."""
        canonical = [" ".join(self.words[token] for token in row) for row in ids]
        return list(self.codec.decode(canonical, list(legends)))

    def decode_completions(
        self, prompts: Sequence[Sequence[int]], completions: Sequence[Sequence[int]], legends: Sequence[Any]
    ) -> list[str]:
        """The completions' texts without the space that parts them from their prompts."""
        wholes = self.decode([[*p, *c] for p, c in zip(prompts, completions, strict=True)], legends)
        starts = self.decode(prompts, legends)
        return [whole[len(start) :].removeprefix(" ") for whole, start in zip(wholes, starts, strict=True)]

    def _ids(self, text: str) -> Ids:
        try:
            return np.array([self.ids[word] for word in text.split(" ")], dtype=np.int32)
        except KeyError as error:
            raise TokenizerError(_no_token(error.args[0], self.max_slots)) from None


def _no_token(word: str, max_slots: int) -> str:
    if word[:1] == "o" and word[1:].isdigit():
        return f"more objects than the tokenizer's {max_slots} slots\nhint: train with a larger `tokenizer.max_slots`"
    return f"the tokenizer has no token for {word!r}"


def _word_level(ids: dict[str, int]) -> PreTrainedTokenizerFast:
    tokenizer = Tokenizer(models.WordLevel(ids, unk_token=END))
    tokenizer.pre_tokenizer = pre_tokenizers.WhitespaceSplit()
    hf = PreTrainedTokenizerFast(tokenizer_object=tokenizer, bos_token=START, eos_token=END, pad_token=END)
    extra = [AddedToken(word, special=True, normalized=False) for word in SPECIAL[1:]]
    hf.add_special_tokens({"additional_special_tokens": extra})
    return hf
