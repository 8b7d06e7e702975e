"""A static-cache decoder for GPT-2-shaped weights: token ids in, next-token logits out.

It reads the weights of a transformers GPT-2 (any of its heads) and runs them as plain batched matrix products over a
static cache. Rows are aligned to the left and padded to the right: a row's tokens always sit at positions 0, 1, 2, …,
so padding is never attended to and needs no correction. One call, `feed`, is prefill, step and chunk alike.

Only attention sees padding: all other layers run over the real tokens alone, and the last layer, once its keys are
written, over each row's last token.

Price: one step costs O(rows × positions × width) for the attention, whatever the padding; the cache holds
2 × layers × rows × positions × width numbers. It knows no text, no sampling and no stopping.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import torch
import torch.nn.functional as F
from transformers.activations import ACT2FN

if TYPE_CHECKING:
    from collections.abc import Callable

    from torch import Tensor, nn


@dataclass(frozen=True, slots=True)
class Layer:
    """The weights of one transformer block, as views on the model's own parameters."""

    norm_1: tuple[Tensor, Tensor]
    attention: tuple[Tensor, Tensor]
    projection: tuple[Tensor, Tensor]
    norm_2: tuple[Tensor, Tensor]
    widen: tuple[Tensor, Tensor]
    narrow: tuple[Tensor, Tensor]
    scale: float


def _pair(module: nn.Module) -> tuple[Tensor, Tensor]:
    """A module's weight and bias, without their gradients."""
    weight, bias = module.weight, module.bias
    assert isinstance(weight, torch.Tensor)
    assert isinstance(bias, torch.Tensor)
    return weight.detach(), bias.detach()


def _read_layer(block: Any, index: int, config: Any) -> Layer:
    """The weights of `block`, the `index`-th of the model."""
    scale = (config.n_embd // config.n_head) ** -0.5 if config.scale_attn_weights else 1.0
    if config.scale_attn_by_inverse_layer_idx:
        scale /= index + 1
    return Layer(
        norm_1=_pair(block.ln_1),
        attention=_pair(block.attn.c_attn),
        projection=_pair(block.attn.c_proj),
        norm_2=_pair(block.ln_2),
        widen=_pair(block.mlp.c_fc),
        narrow=_pair(block.mlp.c_proj),
        scale=scale,
    )


@dataclass(frozen=True, slots=True)
class Chunk:
    """Where the tokens of one call go: `n` rows of up to `m` tokens each, `t` in all."""

    first: int
    """The first of the rows."""
    at: Tensor
    """(n, m) the position of each token and of the padding after it."""
    real: Tensor
    """(n, m) which of them are tokens."""
    rows: Tensor
    """(t) the row of each token."""
    places: Tensor
    """(t) the position of each token."""
    top: int
    """One more than the last position."""

    @classmethod
    def of(cls, start: Tensor, first: int, counts: Tensor, width: int) -> Chunk:
        """The chunk of `counts` (n) tokens for the rows from `first` on, which hold `start` (n) tokens already."""
        steps = torch.arange(width, device=start.device)
        at, real = start[:, None] + steps, steps < counts[:, None]
        rows = torch.arange(first, first + len(start), device=start.device)[:, None].expand_as(at)
        return cls(first, at, real, rows[real], at[real], int((start + counts).max()))

    def mask(self, like: Tensor) -> Tensor:
        """(n, 1, m, top), added to the scores: minus infinity for positions later than the asking token's, else 0."""
        later = torch.arange(self.top, device=like.device) > self.at[:, None, :, None]
        return torch.zeros(later.shape, dtype=like.dtype, device=like.device).masked_fill_(later, -torch.inf)

    def spread(self, values: Tensor) -> Tensor:
        """(t, …) as (n, m, …), zero where there is padding."""
        if self.real.shape[1] == 1:
            return values[:, None]
        return values.new_zeros(*self.real.shape, *values.shape[1:]).index_put((self.real,), values)

    def gather(self, values: Tensor) -> Tensor:
        """(n, m, …) without the padding, as (t, …)."""
        return values[:, 0] if self.real.shape[1] == 1 else values[self.real]


class Gpt2Decoder:
    """Next-token logits of a GPT-2 model over rows of a static cache.

    `model` is any transformers model with a `transformer` (GPT2Model) and an `lm_head`; its weights are shared.
    `lengths[row]` tells how many tokens of a row the cache holds.
    """

    def __init__(self, model: Any, rows: int) -> None:
        """A decoder with an empty cache of `rows` rows."""
        body, self.config = model.transformer, model.config
        self.layers = [_read_layer(block, i, self.config) for i, block in enumerate(body.h)]
        self.tokens: Tensor = body.wte.weight.detach()
        self.places: Tensor = body.wpe.weight.detach()
        self.norm, self.head = _pair(body.ln_f), model.lm_head.weight.detach()
        self.activation: Callable[[Tensor], Tensor] = _activation(self.config.activation_function)
        self.context: int = self.config.n_positions
        self.lengths = torch.zeros(rows, dtype=torch.long, device=self.tokens.device)
        self.keys = [self._room(rows, 0) for _ in self.layers]
        self.values = [self._room(rows, 0) for _ in self.layers]

    def _room(self, rows: int, positions: int) -> Tensor:
        """An empty cache of one layer: (rows, heads, positions, width of a head)."""
        heads = self.config.n_head
        shape = rows, heads, positions, self.config.n_embd // heads
        return torch.zeros(shape, dtype=self.tokens.dtype, device=self.tokens.device)

    def _reserve(self, positions: int) -> None:
        """Room for `positions` positions in every row, growing by half so that the copies stay O(1) a token."""
        have = self.keys[0].shape[2]
        if positions <= have:
            return
        room = min(max(positions, have + have // 2, 64), max(positions, self.context))
        for caches in (self.keys, self.values):
            for i, old in enumerate(caches):
                caches[i] = self._room(old.shape[0], room)
                caches[i][:, :, :have] = old

    def move(self, sources: Tensor, targets: Tensor) -> None:
        """Copy the rows `sources` over the rows `targets`."""
        if len(sources) == 0:
            return
        used = int(self.lengths[sources].max())
        for cache in (*self.keys, *self.values):
            cache[targets, :, :used] = cache[sources, :, :used]
        self.lengths[targets] = self.lengths[sources]

    def clear(self, first: int, count: int) -> None:
        """Forget the tokens of the rows `first` to `first + count`."""
        self.lengths[first : first + count] = 0

    def rewind(self, row: int, count: int) -> int:
        """Forget the tokens of a row but the first `count`; how many are left."""
        self.lengths[row] = count
        return count

    def feed(self, first: int, ids: Tensor, counts: Tensor) -> Tensor:
        """Append tokens to the rows from `first` on, and give the logits after the last token of each.

        `ids` is (n, m), padded to the right; `counts` (n) says how many of the m are real, at least one each. The
        result is (n, vocabulary). Only attention sees the padding.
        """
        chunk = Chunk.of(self.lengths[first : first + len(ids)], first, counts, ids.shape[1])
        self._reserve(chunk.top)
        places = F.embedding(chunk.places.clamp(max=self.context - 1), self.places)
        hidden = F.embedding(chunk.gather(ids), self.tokens) + places
        mask = chunk.mask(hidden)
        for i in range(len(self.layers) - 1):
            hidden = self._block(i, hidden, chunk, mask)
        last = self._block(len(self.layers) - 1, hidden, chunk, mask, counts.cumsum(0) - 1)
        self.lengths[first : first + len(ids)] += counts
        return F.linear(F.layer_norm(last, self.norm[0].shape, *self.norm, self.config.layer_norm_epsilon), self.head)

    def _block(self, index: int, hidden: Tensor, chunk: Chunk, mask: Tensor, only: Tensor | None = None) -> Tensor:
        """One transformer block over (t, width); after the attention, of the tokens `only` where those are given."""
        layer, eps = self.layers[index], self.config.layer_norm_epsilon
        mixed = self._attend(index, F.layer_norm(hidden, layer.norm_1[0].shape, *layer.norm_1, eps), chunk, mask)
        if only is not None and len(only) < len(hidden):
            mixed, hidden = mixed[only], hidden[only]
        hidden = _affine(mixed, layer.projection) + hidden
        normed = F.layer_norm(hidden, layer.norm_2[0].shape, *layer.norm_2, eps)
        return _affine(self.activation(_affine(normed, layer.widen)), layer.narrow) + hidden

    def _attend(self, index: int, hidden: Tensor, chunk: Chunk, mask: Tensor) -> Tensor:
        """Write the new keys and values, then attend to all that the mask lets through: (t, width)."""
        layer, keys, values = self.layers[index], self.keys[index], self.values[index]
        query, key, value = _affine(hidden, layer.attention).view(len(hidden), 3, keys.shape[1], -1).unbind(1)
        keys[chunk.rows, :, chunk.places] = key
        values[chunk.rows, :, chunk.places] = value
        held = slice(chunk.first, chunk.first + len(chunk.real)), slice(None), slice(chunk.top)
        # Reading the cache is most of a step; the fused kernel reads it once and writes no scores.
        asked = chunk.spread(query).transpose(1, 2)
        mixed = F.scaled_dot_product_attention(asked, keys[held], values[held], attn_mask=mask, scale=layer.scale)
        return chunk.gather(mixed.transpose(1, 2)).flatten(1)


def _affine(x: Tensor, weights: tuple[Tensor, Tensor]) -> Tensor:
    """`x W + b` of (t, in), for the (in, out) layout of GPT-2's weights."""
    weight, bias = weights
    return torch.addmm(bias, x, weight)


def _activation(name: str) -> Callable[[Tensor], Tensor]:
    """The activation that a configuration names; GPT-2's own as one fused operation."""
    if name == "gelu_new":
        return lambda x: F.gelu(x, approximate="tanh")
    return ACT2FN[name]  # type: ignore[no-any-return]
