"""The training forward pass over transformers' own GPT-2 parameters.

It computes what `GPT2Model` computes (a test holds the two equal in float64), with four differences that pay on
two CPU cores, and the first three on a GPU:

- weights and activations are cast to the compute type once a pass, instead of op by op under autocast;
- attention takes rows of any length, one behind the other, so that nothing is padded (`strips_lm.attention`);
- after the last layer's attention only the positions that a loss reads go on: the rest of the layer, the final norm
  and the head never see prompts;
- what a negative has in common with its positive, the prompt and often half of the plan, goes through once.

Rows come as blocks of one length, one behind the other; where they are padded, it is on the right, so that causal
attention needs no mask besides the triangle. All tokens together are padded to a multiple of `GRAIN`. What a layer
does on either side of attention is two functions of (tokens, width), which `torch.compile` may take: they see one
varying size, whatever the blocks are. It knows nothing of losses, batches or devices.
"""

from __future__ import annotations

import math
from functools import cache
from typing import TYPE_CHECKING, Any, NamedTuple

import torch
from torch.nn import functional as F
from transformers.activations import ACT2FN

from strips_lm.attention import Rows, attend, kernel

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from torch import Tensor

    Blocks = Sequence[tuple[int, ...]]


GRAIN = 128
"""Matrix products get a multiple of this many rows: oneDNN makes its bfloat16 kernels anew for each number of rows that
it has not met, which takes ten times as long as the product itself, and there are only so many multiples."""


def hidden_at(
    transformer: Any,
    input_ids: Tensor,
    position_ids: Tensor,
    at: Tensor,
    dtype: torch.dtype,
    *,
    blocks: Blocks = (),
    borrowed: Sequence[int] = (),
    compiled: bool = False,
    inputs: list[Tensor] | None = None,
) -> Tensor:
    """Final hidden states (len(at), width) of the positions `at`, indices into the flattened tokens.

    The tokens are (rows, length), or flat in `blocks` of such tables. Before its own tokens a row has as many as it
    `borrowed`: the first of the last row before it that borrowed none. `compiled` runs the layers compiled where
    gradients are recorded. What goes into each layer, (tokens or more, width),
    is appended to `inputs`.
    """
    blocks = blocks or (tuple(input_ids.shape),)
    scored = len(at)
    hidden = rounded(_embed(transformer, input_ids, position_ids).to(dtype).view(input_ids.numel(), -1))
    at = F.pad(at, (0, -scored % GRAIN))
    last = len(transformer.h) - 1
    sides = compiled_sides() if compiled and torch.is_grad_enabled() else Sides(_before, _after)
    rows = Rows.of(transformer, hidden, blocks, borrowed)
    for index, block in enumerate(transformer.h):
        if inputs is not None:
            inputs.append(hidden)
        attended = attend(block.attn, sides.before(block, hidden), rows)
        if index == last:
            attended, hidden = attended[at], hidden[at]
        hidden = sides.after(block, hidden, attended)
    return final_norm(transformer, hidden[:scored])


def final_norm(transformer: Any, hidden: Tensor) -> Tensor:
    """(n, width) hidden states as the heads read them."""
    return _norm(transformer.ln_f, hidden)


def rounded(rows: Tensor) -> Tensor:
    """(n, width) with zeros below, up to a multiple of `GRAIN` rows."""
    return F.pad(rows, (0, 0, 0, -len(rows) % GRAIN))


class Layout(NamedTuple):
    """How the rows of a batch should lie for training to be quick."""

    spread: float
    """How unlike in length, as a share, the rows of a block may be."""
    borrow: bool
    """Whether a negative borrows what it has in common with its positive."""


def best_layout(device: torch.device, dtype: torch.dtype, dropout: float) -> Layout:
    """The layout for a device and a type.

    Where attention takes rows of any length, nothing is padded. Else small blocks spare a CPU the padding, and a GPU
    prefers one large table. Beginnings are shared where attention need not repeat them.
    """
    found = kernel(device, dtype, dropout)
    if found != "blocks":
        return Layout(0.0, found == "native")
    return Layout(0.1 if device.type == "cpu" else math.inf, borrow=False)


class Sides(NamedTuple):
    """A layer's two sides of attention."""

    before: Callable[[Any, Tensor], Tensor]
    """From hidden states to query, key and value, (tokens, 3 * width)."""
    after: Callable[[Any, Tensor, Tensor], Tensor]
    """From hidden states and what was attended to the next hidden states."""


@cache
def compiled_sides() -> Sides:
    """Both sides compiled, each once for all layers and any number of tokens."""
    return Sides(torch.compile(_before, dynamic=True), torch.compile(_after, dynamic=True))


def _before(block: Any, hidden: Tensor) -> Tensor:
    return _linear(block.attn.c_attn, _norm(block.ln_1, hidden))


def _after(block: Any, hidden: Tensor, attended: Tensor) -> Tensor:
    hidden = hidden + _drop(_linear(block.attn.c_proj, attended), block.attn.resid_dropout)
    return hidden + _feed(block.mlp, _norm(block.ln_2, hidden))


def _embed(transformer: Any, input_ids: Tensor, position_ids: Tensor) -> Tensor:
    return _drop(transformer.wte(input_ids) + transformer.wpe(position_ids), transformer.drop)


def _feed(mlp: Any, hidden: Tensor) -> Tensor:
    return _drop(_linear(mlp.c_proj, activate(mlp.act, _linear(mlp.c_fc, hidden))), mlp.dropout)


def activate(act: Any, hidden: Tensor) -> Tensor:
    """The block's activation; GPT-2's `gelu_new` in its fused form, which is the same function in one pass."""
    activated: Tensor = F.gelu(hidden, approximate="tanh") if isinstance(act, _GELU_NEW) else act(hidden)
    return activated


_GELU_NEW = type(ACT2FN["gelu_new"])


def _norm(norm: Any, hidden: Tensor) -> Tensor:
    weight, bias = norm.weight.to(hidden.dtype), norm.bias.to(hidden.dtype)
    return F.layer_norm(hidden, norm.normalized_shape, weight, bias, norm.eps)


def _linear(layer: Any, hidden: Tensor) -> Tensor:
    """GPT-2's `Conv1D`: a linear layer whose weight is stored (in, out)."""
    return torch.addmm(layer.bias.to(hidden.dtype), hidden, layer.weight.to(hidden.dtype))


def _drop(hidden: Tensor, dropout: Any) -> Tensor:
    return F.dropout(hidden, dropout.p, dropout.training) if dropout.p > 0.0 else hidden
