"""Byte-level BPE over the text as it stands: the pre-trained GPT-2's with our special tokens, or one of our own."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Self

import numpy as np
from tokenizers import AddedToken, Tokenizer, decoders, models, pre_tokenizers, trainers
from transformers import AutoTokenizer, PreTrainedTokenizerFast

from strips_lm.tokenizer.base import END, SPECIAL, START, TokenizerError, write_settings

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence
    from pathlib import Path

    from strips_lm._native import Domain
    from strips_lm.tokenizer.base import Ids


class BpeTokenizer:
    """A `PlanTokenizer` over a byte-level BPE; it needs no legends, its ids say everything."""

    slots: tuple[tuple[int, int], ...] = ()

    def __init__(self, hf: PreTrainedTokenizerFast) -> None:
        """Add our special tokens to a byte-level BPE that has GPT-2's `<|endoftext|>`."""
        if END not in hf.get_vocab():
            raise TokenizerError(f"the tokenizer has no {END}\nhint: give GPT-2's, or one of its kind")
        hf.add_special_tokens(
            {
                "bos_token": AddedToken(START, special=True, normalized=False),
                "additional_special_tokens": [AddedToken(word, special=True, normalized=False) for word in SPECIAL[1:]],
            }
        )
        hf.eos_token = hf.pad_token = END
        self.hf = hf

    @classmethod
    def pretrained(cls, source: str) -> BpeTokenizer:
        """A pre-trained tokenizer by its name on the hub or its folder.

        Raises:
            TokenizerError: there is none, or it is not of GPT-2's kind.
        """
        try:
            hf: Any = AutoTokenizer.from_pretrained(source)
        except OSError as error:
            raise TokenizerError(f"no tokenizer `{source}`: {str(error).splitlines()[0]}") from None
        return cls(hf)

    @classmethod
    def train(cls, texts: Iterable[str], vocab_size: int) -> BpeTokenizer:
        """A byte-level BPE of `vocab_size` tokens, ours included, learnt from texts."""
        tokenizer = Tokenizer(models.BPE())
        tokenizer.pre_tokenizer = pre_tokenizers.ByteLevel(add_prefix_space=False)
        tokenizer.decoder = decoders.ByteLevel()
        trainer = trainers.BpeTrainer(
            vocab_size=vocab_size,
            special_tokens=[END, *SPECIAL],
            initial_alphabet=pre_tokenizers.ByteLevel.alphabet(),
            show_progress=False,
        )
        tokenizer.train_from_iterator(texts, trainer)
        fast: Any = PreTrainedTokenizerFast
        return cls(fast(tokenizer_object=tokenizer, eos_token=END, bos_token=START))

    @classmethod
    def load(cls, folder: str | Path) -> BpeTokenizer:
        """The tokenizer that `save_pretrained` wrote."""
        return cls(PreTrainedTokenizerFast.from_pretrained(folder))

    def save_pretrained(self, folder: str | Path) -> None:
        """Writes transformers' files and our settings."""
        self.hf.save_pretrained(folder)
        write_settings(folder, {"kind": "bpe"})

    @property
    def vocab_size(self) -> int:
        """Ids run from 0 to this, exclusive."""
        return len(self.hf)

    @property
    def start_id(self) -> int:
        """The token that begins a record."""
        return self.hf.get_vocab()[START]

    @property
    def end_id(self) -> int:
        """The token that ends a record, and pads."""
        return self.hf.get_vocab()[END]

    def of_domain(self, domain: Domain) -> Self:
        """Itself: spelled text is of no domain."""
        del domain
        return self

    @property
    def slotted(self) -> Self:
        """Itself: a model sees the tokens that are stored."""
        return self

    def spelling(self, most: int) -> None:
        """None: no names are drawn."""
        del most

    def encode_prompts(self, prompts: Sequence[str]) -> tuple[list[Ids], list[Any]]:
        """Token ids of each prompt; legends are None."""
        return self._encode(prompts), [None] * len(prompts)

    def encode_records(
        self, prompts: Sequence[str], completions: Sequence[str], words: Sequence[Sequence[str]] | None = None
    ) -> tuple[list[Ids], list[Ids], list[Any]]:
        """Prompt ids and completion ids; a completion's first token is the space before it."""
        del words
        return self._encode(prompts), self._encode([f" {text}" for text in completions]), [None] * len(prompts)

    def decode(self, ids: Sequence[Sequence[int]], legends: Sequence[Any]) -> list[str]:
        """The texts of token sequences."""
        del legends
        return [str(self.hf.decode(list(row), clean_up_tokenization_spaces=False)) for row in ids]

    def decode_completions(
        self, prompts: Sequence[Sequence[int]], completions: Sequence[Sequence[int]], legends: Sequence[Any]
    ) -> list[str]:
        """The completions' texts without the space that parts them from their prompts."""
        del prompts
        return [text.removeprefix(" ") for text in self.decode(completions, legends)]

    def say(self, ids: Sequence[int], legend: Any) -> str:
        """The text of tokens."""
        del legend
        return str(self.hf.decode(list(ids))).strip()

    def _encode(self, texts: Sequence[str]) -> list[Ids]:
        encodings = self.hf.backend_tokenizer.encode_batch_fast(list(texts), add_special_tokens=False)
        return [np.array(encoding.ids, dtype=np.int32) for encoding in encodings]
