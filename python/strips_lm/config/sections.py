"""The sections of a run's configuration, one dataclass per concern, one line of documentation per field.

A field's owner is the module that reads it; a contradiction is rejected where the section is made.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from strips_lm.config.names import ConfigError


def check(holds: bool, complaint: str) -> None:
    """Raises `ConfigError` with the complaint unless it holds."""
    if not holds:
        raise ConfigError(complaint)


@dataclass(frozen=True, kw_only=True, slots=True)
class DataConfig:
    """What `gen-data` makes."""

    domain: str = "manipulation"
    """A built-in domain's name, or a folder with the same files."""
    pairs: int = 71_128
    """Pairs of a plan and a negative, over training and validation."""
    max_steps: int = 7
    """The longest plan, in steps."""

    def __post_init__(self) -> None:
        check(self.pairs > 0, "`data.pairs` must be positive")
        check(self.max_steps > 0, "`data.max_steps` must be positive")


@dataclass(frozen=True, kw_only=True, slots=True)
class TokenizerConfig:
    """How text becomes tokens."""

    kind: Literal["canonical", "bpe"] = "canonical"
    """`canonical`: the lossless rewriting and a small vocabulary of words; `bpe`: byte-level BPE over the text."""


@dataclass(frozen=True, kw_only=True, slots=True)
class ModelConfig:
    """The network."""

    kind: Literal["double-head", "lm-head", "lstm"] = "double-head"
    """Which of the three models."""


@dataclass(frozen=True, kw_only=True, slots=True)
class TrainConfig:
    """The training loop."""


@dataclass(frozen=True, kw_only=True, slots=True)
class GenerateConfig:
    """How plans are decoded."""


@dataclass(frozen=True, kw_only=True, slots=True)
class EvaluateConfig:
    """What is scored."""
