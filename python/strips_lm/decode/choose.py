"""How the next token is chosen from logits: greedy, or sampled from a truncated distribution.

Randomness comes in as one uniform number a row, so that a sample is a function of (seed, prompt, draw, position) alone
and not of the batch that a row happened to share.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import torch

if TYPE_CHECKING:
    from torch import Tensor


@dataclass(frozen=True, slots=True)
class Greedy:
    """The likeliest token; of equals the first."""

    def __call__(self, logits: Tensor, uniform: Tensor) -> Tensor:
        """The chosen tokens (n) for logits (n, vocabulary)."""
        del uniform
        return logits.argmax(-1)


@dataclass(frozen=True, slots=True)
class Sample:
    """Draw from the `top_k` likeliest tokens, of these from the fewest that hold `top_p` of the probability.

    The order is transformers': temperature, then top-k, then top-p on what top-k left. `top_k` 0 keeps all.
    """

    top_k: int = 10
    top_p: float = 0.9
    temperature: float = 1.0

    def __call__(self, logits: Tensor, uniform: Tensor) -> Tensor:
        """The chosen tokens (n) for logits (n, vocabulary) and uniform numbers (n) in [0, 1)."""
        kept = min(self.top_k or logits.shape[-1], logits.shape[-1])
        top, tokens = (logits.float() / self.temperature).topk(kept, dim=-1)
        share = top.softmax(-1)
        before = share.cumsum(-1) - share
        share = share.masked_fill((before >= self.top_p) & (before > 0), 0.0)
        reach = share.cumsum(-1)
        drawn = torch.searchsorted(reach, (uniform * reach[:, -1])[:, None].to(reach.dtype), right=True)
        last = (share > 0).sum(-1, keepdim=True) - 1
        return tokens.gather(-1, torch.minimum(drawn, last)).squeeze(-1)


def uniforms(seed: int, prompt: int, draw: int, count: int) -> Tensor:
    """The `count` uniform numbers that belong to one draw for one prompt."""
    generator = torch.Generator().manual_seed(hash_seed(seed, prompt, draw))
    return torch.rand(count, generator=generator)


def hash_seed(*parts: int) -> int:
    """A 63-bit seed from several numbers, by rounds of splitmix64."""
    state = 0
    for part in parts:
        state = (state ^ (part & 0xFFFF_FFFF_FFFF_FFFF)) + 0x9E37_79B9_7F4A_7C15 & 0xFFFF_FFFF_FFFF_FFFF
        state = (state ^ state >> 30) * 0xBF58_476D_1CE4_E5B9 & 0xFFFF_FFFF_FFFF_FFFF
        state = (state ^ state >> 27) * 0x94D0_49BB_1331_11EB & 0xFFFF_FFFF_FFFF_FFFF
        state ^= state >> 31
    return state >> 1
