"""Batched decoding over token ids: decoders, choices, the loop. It knows no text and no planning."""

from strips_lm.decode.choose import Greedy, Sample
from strips_lm.decode.loop import Decoder, Generation, Job, Limits, Loop, run_jobs

__all__ = ["Decoder", "Generation", "Greedy", "Job", "Limits", "Loop", "Sample", "run_jobs"]
