"""Which guide leads a model: the oracle in the tokens that the model writes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from strips_lm.guide import OracleGuide
from strips_lm.spelled_guide import SpelledGuide
from strips_lm.tokenizer import SpelledTokenizer, TypedTokenizer
from strips_lm.typed_guide import TypedGuide

if TYPE_CHECKING:
    from collections.abc import Sequence

    from strips_lm.guide import Tasks
    from strips_lm.tokenizer import PlanTokenizer


def oracle_guide(tokenizer: PlanTokenizer, legends: Sequence[Any], tasks: Tasks) -> OracleGuide:
    """The guide for prompts in a tokenizer's tokens.

    Raises:
        ConfigError: the tokenizer's texts are not of canonical words, or of another domain than the tasks.
    """
    if isinstance(tokenizer, SpelledTokenizer):
        return SpelledGuide(tokenizer, legends, tasks)
    if isinstance(tokenizer, TypedTokenizer):
        return TypedGuide(tokenizer, legends, tasks)
    return OracleGuide(tokenizer, legends, tasks)
