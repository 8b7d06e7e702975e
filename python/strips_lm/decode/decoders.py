"""Which decoder a model gets."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

from strips_lm.decode import gpt2_cpu
from strips_lm.decode.gpt2 import Gpt2Decoder
from strips_lm.decode.lstm import LstmDecoder
from strips_lm.lstm import LstmLMHeadModel

if TYPE_CHECKING:
    from collections.abc import Callable

    from strips_lm.decode.loop import Decoder


@dataclass(frozen=True, slots=True)
class Decoders:
    """Makes decoders for one model."""

    make: Callable[[int], Decoder]
    most_stepping: int = sys.maxsize
    """More rows than this are slower where each is given a token at a time."""

    def __call__(self, rows: int) -> Decoder:
        """A decoder of so many rows."""
        return self.make(rows)


def decoders_of(model: Any) -> Decoders:
    """What makes decoders for a model as it is now."""
    if isinstance(model, LstmLMHeadModel):
        return Decoders(partial(LstmDecoder, model))
    if gpt2_cpu.fits(model):
        return Decoders(partial(gpt2_cpu.Gpt2CpuDecoder, gpt2_cpu.pack(model)), gpt2_cpu.ROWS)
    return Decoders(partial(Gpt2Decoder, model))
