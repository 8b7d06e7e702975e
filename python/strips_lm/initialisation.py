"""What a GPT-2 starts from beside random weights: positions as sinusoids, heads that look a few tokens back.

Neither changes the architecture: any weights of ours could have been learnt from random ones, only later.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import torch

if TYPE_CHECKING:
    from collections.abc import Sequence

    from torch import Tensor

LONGEST = 10_000.0
"""How much slower than the fastest the slowest wave of the sinusoids is (Vaswani et al. 2017)."""
SPREAD = 4.0
"""How much larger than the other embeddings positions start (docs/experiments.md)."""
WAVES = 8
"""Waves by which a head finds the token that it looks back to."""
SHARPNESS = 4.0
"""What queries and keys of such a head multiply them by: the token looked for gets 0.99 of the attention."""


def sinusoids(positions: int, width: int) -> Tensor:
    """(positions, width) sines and cosines (Vaswani et al. 2017) that learned positions may start from."""
    rates = torch.exp(torch.arange(0, width, 2) * (-math.log(LONGEST) / width))
    angles = torch.arange(positions)[:, None] * rates[None, :]
    return torch.stack((angles.sin(), angles.cos()), dim=-1).reshape(positions, -1)[:, :width]


@torch.no_grad()
def start_from_sinusoids(model: Any) -> None:
    """Let a GPT-2's learned positions start as sinusoids of four times the spread of the other embeddings."""
    table = model.transformer.wpe.weight
    table.copy_(sinusoids(*table.shape) * (SPREAD * 2**0.5 * model.config.initializer_range))


@torch.no_grad()
def start_from_looking_back(model: Any, heads: int) -> None:
    """Let the first `heads` heads of a GPT-2's first block look at the token before, the one before that, and so on.

    A sum of a few fast sinusoids of a distance is highest where that is 0, so that a query turned back by n tokens
    finds the key n tokens before, wherever it is. Which objects stand together in an atom is read by such a head and
    one after it that finds an equal token (Olsson et al. 2022, In-context Learning and Induction Heads); from random
    weights a model of minutes comes to it late, or not at all (docs/experiments.md).

    Call after `start_from_sinusoids`; the embeddings of tokens leave these waves to positions at first.
    """
    if heads:
        size = model.config.n_embd // model.config.n_head
        waves = _waves(model.config.n_embd, size)
        for sine, cosine, _ in waves:
            model.transformer.wte.weight[:, [sine, cosine]] = 0.0
        for head in range(heads):
            _look_back(model.transformer.h[0].attn, head * size, head + 1, waves)


Wave = tuple[int, int, float]
"""The columns of a position's sine and cosine, and their rate."""


def _waves(width: int, size: int) -> list[Wave]:
    """The waves that a head of `size` finds distances by: of a width of 128 the fastest, of others about the same."""
    numbers = range(0, width // 2, max(1, width // 128))[: min(WAVES, size // 2)]
    return [(2 * number, 2 * number + 1, LONGEST ** (-2 * number / width)) for number in numbers]


def _look_back(attention: Any, first: int, tokens: int, waves: Sequence[Wave]) -> None:
    """Make of the head whose outputs start at column `first` one that looks `tokens` back."""
    weight: Tensor = attention.c_attn.weight
    width, size = attention.embed_dim, attention.head_dim
    query, key, value = (slice(part * width + first, part * width + first + size) for part in range(3))
    weight[:, query] = weight[:, key] = 0.0
    for column, (sine, cosine, rate) in zip(range(first, first + size, 2), waves, strict=False):
        along, across = SHARPNESS * math.cos(rate * tokens), SHARPNESS * math.sin(rate * tokens)
        weight[sine, column], weight[cosine, column] = along, -across
        weight[sine, column + 1], weight[cosine, column + 1] = across, along
        weight[sine, width + column] = weight[cosine, width + column + 1] = SHARPNESS
    weight[:, value].normal_(std=width**-0.5)
    attention.c_proj.weight[query].normal_(std=0.02)
