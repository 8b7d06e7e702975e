"""The training forward pass over transformers' own GPT-2 parameters.

It computes what `GPT2Model` computes (a test holds the two equal in float64), with three differences that pay on
two CPU cores and cost nothing on a GPU:

- weights and activations are cast to the compute type once a pass, instead of op by op under autocast;
- on a CPU attention is spelled out, since the bfloat16 backward of SDPA is slow there;
- after the last layer's attention only the positions that a loss reads go on: the rest of the layer, the final norm
  and the head never see prompts.

Rows are padded on the right, so that causal attention needs no mask besides the triangle. It knows nothing of
losses, batches or devices. Rejected: computing a pair's shared prompt once (packing both completions behind it with a
block mask) saves a quarter of the linear work and loses as much in attention over the longer rows.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import torch
from torch.nn import functional as F
from transformers.activations import ACT2FN

if TYPE_CHECKING:
    from torch import Tensor


def hidden_at(transformer: Any, input_ids: Tensor, position_ids: Tensor, at: Tensor, dtype: torch.dtype) -> Tensor:
    """Final hidden states (len(at), width) of the positions `at`, indices into the flattened (rows * length) tokens."""
    rows, length = input_ids.shape
    hidden = _embed(transformer, input_ids, position_ids).to(dtype).view(rows * length, -1)
    triangle = _triangle(length, dtype, hidden.device)
    last = len(transformer.h) - 1
    for index, block in enumerate(transformer.h):
        attended = _attend(block.attn, _norm(block.ln_1, hidden), rows, triangle)
        if index == last:
            attended, hidden = attended[at], hidden[at]
        hidden = hidden + _drop(_linear(block.attn.c_proj, attended), block.attn.resid_dropout)
        hidden = hidden + _feed(block.mlp, _norm(block.ln_2, hidden))
    return _norm(transformer.ln_f, hidden)


def _embed(transformer: Any, input_ids: Tensor, position_ids: Tensor) -> Tensor:
    return _drop(transformer.wte(input_ids) + transformer.wpe(position_ids), transformer.drop)


def _attend(attention: Any, hidden: Tensor, rows: int, triangle: Tensor) -> Tensor:
    """Causal self-attention of (rows * length, width), before the output projection."""
    tokens, width = hidden.shape
    heads = attention.num_heads
    parts = _linear(attention.c_attn, hidden).view(rows, tokens // rows, 3, heads, width // heads)
    query, key, value = parts.permute(2, 0, 3, 1, 4)
    attend = _attend_plainly if hidden.device.type == "cpu" else _attend_fused
    return attend(query, key, value, triangle, attention).transpose(1, 2).reshape(tokens, width)


def _attend_plainly(query: Tensor, key: Tensor, value: Tensor, triangle: Tensor, attention: Any) -> Tensor:
    rows, heads, length, size = query.shape
    query, key, value = (part.reshape(rows * heads, length, size) for part in (query, key, value))
    scores = torch.baddbmm(triangle, query, key.transpose(1, 2), alpha=attention.scaling)
    weights = _drop(torch.softmax(scores, dim=-1), attention.attn_dropout)
    return torch.bmm(weights, value).view(rows, heads, length, size)


def _attend_fused(query: Tensor, key: Tensor, value: Tensor, _triangle: Tensor, attention: Any) -> Tensor:
    dropout = attention.attn_dropout.p if attention.training else 0.0
    return F.scaled_dot_product_attention(query, key, value, dropout_p=dropout, is_causal=True, scale=attention.scaling)


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


def _triangle(length: int, dtype: torch.dtype, device: torch.device) -> Tensor:
    """(length, length): 0 where a token may look, a large negative number after it."""
    lowest = torch.full((length, length), torch.finfo(dtype).min / 2, dtype=dtype, device=device)
    return lowest.triu(1)


def sinusoids(positions: int, width: int) -> Tensor:
    """(positions, width) sines and cosines (Vaswani et al. 2017) that learned positions may start from."""
    rates = torch.exp(torch.arange(0, width, 2) * (-math.log(10_000.0) / width))
    angles = torch.arange(positions)[:, None] * rates[None, :]
    return torch.stack((angles.sin(), angles.cos()), dim=-1).reshape(positions, -1)[:, :width]
