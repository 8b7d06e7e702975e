"""The canonical rewriting (Rust) and a word for every token of it.

The codec maps a text to words, and a legend that gives the text back. The vocabulary is closed: the special tokens,
every word the codec may write for this domain, and last, in one contiguous block, the object slots, so that training
may renumber them by arithmetic. Only hints that a user's own prompt also has are given to the codec, so that training
and generation see the same tokens.
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
    from typing import Literal

    from numpy.typing import NDArray

    from strips_lm.tokenizer.base import Ids

DOMAIN, LEXICON, CODEC = "domain.pddl", "lexicon.toml", "codec.json"
"""The files of a data set that the codec is made of, and the file of a saved tokenizer that holds it."""


class CanonicalTokenizer:
    """A `PlanTokenizer` over the canonical rewriting of one domain."""

    def __init__(self, codec: _native.CanonicalCodec, max_slots: int) -> None:
        """Give every word of the codec an id, and `max_slots` slots the last ids."""
        self.codec, self.max_slots = codec, max_slots
        self.words = codec.vocabulary(max_slots)
        self.ids = {word: index for index, word in enumerate(self.words)}
        self.slots = (codec.first_slot, max_slots)
        self.hf = _word_level(self.ids)

    @classmethod
    def of_data(cls, data: Path, max_slots: int, layout: Literal["difference", "report"]) -> CanonicalTokenizer:
        """The tokenizer of a data set's domain and lexicon."""
        domain = _native.Domain.parse((data / DOMAIN).read_bytes(), file=str(data / DOMAIN))
        lexicon = (data / LEXICON).read_text(encoding="utf-8") if (data / LEXICON).is_file() else None
        return cls(_native.CanonicalCodec(domain, lexicon, layout=layout), max_slots)

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

    def _encode(
        self, texts: Sequence[str], words: Sequence[Sequence[str]] | None
    ) -> tuple[list[Ids], NDArray[np.int64], list[Any]]:
        """Token ids of each text, where its prompt ends, and its legend."""
        ids, offsets, cuts, legends = self.codec.encode_ids(texts, words)
        if len(ids) and int(ids.max()) >= self.vocab_size:
            raise TokenizerError(_too_many_objects(self.max_slots))
        return np.split(ids, offsets[1:-1]), cuts, legends


def _too_many_objects(max_slots: int) -> str:
    return f"more objects than the tokenizer's {max_slots} slots\nhint: train with a larger `tokenizer.max_slots`"


def _word_level(ids: dict[str, int]) -> PreTrainedTokenizerFast:
    tokenizer = Tokenizer(models.WordLevel(ids, unk_token=END))
    tokenizer.pre_tokenizer = pre_tokenizers.WhitespaceSplit()
    fast: Any = PreTrainedTokenizerFast
    hf: PreTrainedTokenizerFast = fast(tokenizer_object=tokenizer, bos_token=START, eos_token=END, pad_token=END)
    extra = [AddedToken(word, special=True, normalized=False) for word in SPECIAL[1:] if word in ids]
    hf.add_special_tokens({"additional_special_tokens": extra})
    return hf
