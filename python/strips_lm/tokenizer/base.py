"""What both tokenizers share: the interface, the special tokens, the settings file, the fingerprint."""

from __future__ import annotations

import hashlib
import json
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, Self

from strips_lm._native import DataError

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    import numpy as np
    from numpy.typing import NDArray
    from transformers import PreTrainedTokenizerFast

    from strips_lm._native import Domain
    from strips_lm.spelling import Spelling

    Ids = NDArray[np.int32]

START, END = "<|startoftext|>", "<|endoftext|>"
"""First and last token of a record; the last also pads, as in GPT-2."""

SPECIAL = (START, "<GOAL>", "<INIT>", "<ACTION>", "<STATE>", "<OBJECTS>", "<VOCAB>")
"""The tokens that we add to GPT-2's own 50,257, which makes the report's 50,264."""

SETTINGS = "plan_tokenizer.json"
"""The file beside `tokenizer.json` that says which of ours it is."""


DECIDING = ("tokenizer.json", "codec.json")
"""The files that decide, with the settings, how a tokenizer encodes."""


class TokenizerError(DataError):
    """A tokenizer that cannot be read, or a text that it has no tokens for."""


class PlanTokenizer(Protocol):
    """Between texts of the record format and token ids; `legends` hold what the ids alone do not say."""

    hf: PreTrainedTokenizerFast
    slots: tuple[tuple[int, int], ...]
    """(first, count) of each block of ids that stand for objects and may be renumbered within it; none in some."""

    @property
    def vocab_size(self) -> int:
        """Ids run from 0 to this, exclusive."""

    @property
    def start_id(self) -> int:
        """The token that begins a record."""

    @property
    def end_id(self) -> int:
        """The token that ends a record, and pads."""

    @property
    def slotted(self) -> PlanTokenizer:
        """Itself, or the tokenizer with plain slots that it is made from: `spelling` draws names for these."""

    def spelling(self, most: int) -> Spelling | None:
        """How names are drawn for slots, in records of at most `most` tokens; None where slots, if any, are tokens."""

    def of_domain(self, domain: Domain) -> Self:
        """The same tokens for texts of one domain, of the several that a mixture's tokenizer knows."""

    def encode_prompts(self, prompts: Sequence[str]) -> tuple[list[Ids], list[Any]]:
        """Token ids and a legend for each prompt."""

    def encode_records(
        self, prompts: Sequence[str], completions: Sequence[str], words: Sequence[Sequence[str]] | None = None
    ) -> tuple[list[Ids], list[Ids], list[Any]]:
        """Prompt ids, completion ids and a legend for each record; `words` are its action words by action."""

    def decode(self, ids: Sequence[Sequence[int]], legends: Sequence[Any]) -> list[str]:
        """The texts of token sequences, whole or broken off; byte for byte for what was encoded."""

    def decode_completions(
        self, prompts: Sequence[Sequence[int]], completions: Sequence[Sequence[int]], legends: Sequence[Any]
    ) -> list[str]:
        """The completions' texts alone, without the space that parts them from their prompts."""

    def say(self, ids: Sequence[int], legend: Any) -> str:
        """Tokens as people read them: words, and objects by their names."""

    def save_pretrained(self, folder: str | Path) -> None:
        """Writes the tokenizer's files into a folder."""


def encode_each(encode: Callable[..., tuple[list[Any], ...]], *columns: Sequence[str]) -> list[tuple[Any, ...] | None]:
    """What `encode` makes of each row of the columns; `None` of one that has no tokens, which loses no other."""
    try:
        return list(zip(*encode(*columns), strict=True))
    except TokenizerError:
        half = len(columns[0]) // 2
        parts = (slice(half), slice(half, None)) if half else ()
        return [row for part in parts for row in encode_each(encode, *(column[part] for column in columns))] or [None]


def write_settings(folder: str | Path, settings: dict[str, Any]) -> None:
    """Writes what `load` needs besides the files of transformers."""
    (Path(folder) / SETTINGS).write_text(json.dumps(settings, indent=1) + "\n", encoding="utf-8")


def read_settings(folder: str | Path) -> dict[str, Any]:
    """Reads what `write_settings` wrote.

    Raises:
        TokenizerError: the folder holds no tokenizer of ours.
    """
    path = Path(folder) / SETTINGS
    if not path.is_file():
        raise TokenizerError(f"{folder}: no {SETTINGS}\nhint: give a folder that `strips-lm train` wrote")
    settings: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return settings


def fingerprint(tokenizer: PlanTokenizer) -> str:
    """A SHA-256 of everything that decides how the tokenizer encodes."""
    digest = hashlib.sha256()
    with tempfile.TemporaryDirectory() as folder:
        tokenizer.save_pretrained(folder)
        for path in sorted(Path(folder) / name for name in (SETTINGS, *DECIDING)):
            if not path.is_file():
                continue
            digest.update(path.name.encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()
