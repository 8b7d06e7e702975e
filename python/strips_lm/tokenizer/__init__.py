"""Text to tokens and back, byte for byte: one interface, four ways, each saved beside the model.

`bpe` tokenizes the text as it stands; `canonical` rewrites it first (the Rust `CanonicalCodec`) and then has a word
for every token; `typed` is `canonical` with slots by type, `spelled` with names in pieces. All hold a
`PreTrainedTokenizerFast`. What a text means is not known here.

A record's text is its prompt, a space and its completion. All ways tokenize the two apart, so that a prompt has the
same tokens in training and in generation.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from strips_lm.tokenizer.base import (
    END,
    SPECIAL,
    START,
    PlanTokenizer,
    TokenizerError,
    encode_each,
    fingerprint,
    read_settings,
)
from strips_lm.tokenizer.bpe import BpeTokenizer
from strips_lm.tokenizer.canonical import CanonicalTokenizer
from strips_lm.tokenizer.spelled import SpelledTokenizer
from strips_lm.tokenizer.typed import TypedTokenizer

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

    from strips_lm.config import TokenizerConfig

__all__ = [
    "END",
    "SPECIAL",
    "START",
    "BpeTokenizer",
    "CanonicalTokenizer",
    "PlanTokenizer",
    "SpelledTokenizer",
    "TokenizerError",
    "TypedTokenizer",
    "encode_each",
    "fingerprint",
    "load",
    "make",
]


def load(folder: str | Path) -> PlanTokenizer:
    """The tokenizer that `save_pretrained` wrote into a folder.

    Raises:
        TokenizerError: the folder holds none of ours.
    """
    kind = read_settings(folder)["kind"]
    if kind == "spelled":
        return SpelledTokenizer.load(folder)
    if kind == "typed":
        return TypedTokenizer.load(folder)
    return BpeTokenizer.load(folder) if kind == "bpe" else CanonicalTokenizer.load(folder)


def make(config: TokenizerConfig, data: Path, texts: Iterable[str]) -> PlanTokenizer:
    """The tokenizer that a configuration asks for, for the data set in `data`; `texts` are records to learn from."""
    if config.kind == "typed":
        return TypedTokenizer.of_data(data, config.max_slots, config.layout, config.type_slots)
    if config.kind == "canonical":
        return CanonicalTokenizer.of_data(data, config.max_slots, config.layout)
    if config.kind == "spelled":
        return SpelledTokenizer.of_data(data, texts, config.vocab_size, config.layout, kinds=config.spelled_types)
    return BpeTokenizer.pretrained(config.source) if config.source else BpeTokenizer.train(texts, config.vocab_size)
