"""Which decoder a model gets."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

from strips_lm.decode import gpt2_cpu
from strips_lm.decode.gpt2 import Gpt2Decoder
from strips_lm.decode.lstm import LstmDecoder
from strips_lm.lstm import LstmLMHeadModel

if TYPE_CHECKING:
    from collections.abc import Callable

    from strips_lm.decode.loop import Decoder


def decoders_of(model: Any) -> Callable[[int], Decoder]:
    """What makes decoders of so many rows for a model as it is now."""
    if isinstance(model, LstmLMHeadModel):
        return partial(LstmDecoder, model)
    if gpt2_cpu.fits(model):
        return partial(gpt2_cpu.Gpt2CpuDecoder, gpt2_cpu.pack(model))
    return partial(Gpt2Decoder, model)
