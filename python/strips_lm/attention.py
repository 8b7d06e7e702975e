"""Causal self-attention of the training pass, within each of many rows that lie one behind the other.

Rows of any length attend without padding: on a GPU in half precision by one call of flash attention, on a CPU by the
binding, which works in float32 whatever the layers run in and takes a third of the time of PyTorch's fused kernel
(docs/experiments.md). What neither takes, dropout and double precision among it, goes through PyTorch a block of rows
at a time, each block padded to its longest row.

A row may begin with tokens of another one, which then go through the layers once. The binding attends to them where
they are; for the others they are repeated in each row, in attention alone.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal, NamedTuple, TypeAlias, cast

import numpy as np
import torch
from torch.nn import functional as F

from strips_lm import _native

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray
    from torch import Tensor

    Blocks = Sequence[tuple[int, ...]]


Kernel: TypeAlias = Literal["flash", "native", "blocks"]
"""What attends: PyTorch's flash attention on rows of any length, the binding, or PyTorch on blocks of padded rows."""


def kernel(device: torch.device, dtype: torch.dtype, dropout: float) -> Kernel:
    """The quickest that there is for a device and a type."""
    half = dtype in {torch.bfloat16, torch.float16}
    if not dropout and device.type == "cuda" and half and torch.cuda.get_device_capability(device) >= (8, 0):
        return "flash"
    if not dropout and device.type == "cpu" and dtype in {torch.bfloat16, torch.float32}:
        return "native"
    return "blocks"


class Rows(NamedTuple):
    """Which of the flat tokens attend to each other."""

    blocks: Blocks
    """(rows, length) of each table."""
    kernel: Kernel
    bounds: Tensor
    """Where each row begins, and the last one ends."""
    longest: int
    borrowed: NDArray[np.int64] | None = None
    """How many tokens each row has before its own: the first of the last row before it that borrows none."""

    @classmethod
    def of(cls, transformer: Any, hidden: Tensor, blocks: Blocks, borrowed: Sequence[int] = ()) -> Rows:
        """The rows of `blocks` among the tokens of `hidden`; for flash attention those behind are one more row."""
        dropout = transformer.config.attn_pdrop if transformer.training else 0.0
        found = kernel(hidden.device, hidden.dtype, dropout)
        lengths = [length for rows, length in blocks for _ in range(rows)]
        behind = len(hidden) - sum(lengths)
        if found == "flash" and behind:
            lengths.append(behind)
        bounds = torch.tensor([0, *lengths]).cumsum(0, dtype=torch.int32 if found == "flash" else torch.int64)
        shared = np.array(borrowed, dtype=np.int64) if any(borrowed) else None
        return cls(blocks, found, bounds.to(hidden.device), max(lengths), shared)


def attend(attention: Any, parts: Tensor, rows: Rows) -> Tensor:
    """Causal self-attention of (tokens, 3 * width), row by row, before the output projection: (tokens, width)."""
    if rows.kernel == "native":
        return cast("Tensor", _Native.apply(parts, rows, attention.num_heads, float(attention.scaling)))
    if rows.borrowed is not None:
        return _attend_repeated(attention, parts, rows, rows.borrowed)
    if rows.kernel == "blocks":
        return _attend_blocks(attention, parts, rows.blocks)
    return _attend_rows(attention, parts, rows.bounds, rows.longest)


class _Native(torch.autograd.Function):
    """The binding's attention, as an operation that has a gradient."""

    @staticmethod
    def forward(ctx: Any, parts: Tensor, rows: Rows, heads: int, scale: float) -> Tensor:
        """(tokens, width) from (tokens, 3 * width)."""
        ctx.bounds = rows.bounds.numpy()
        ctx.about = {"heads": heads, "scale": scale, "borrowed": rows.borrowed, "threads": torch.get_num_threads()}
        mixed, normalisers = _native.attend(_numbers(parts), ctx.bounds, **ctx.about)
        ctx.save_for_backward(parts, torch.from_numpy(normalisers))
        return _tensor(mixed)

    @staticmethod
    def backward(ctx: Any, *grads: Tensor) -> tuple[Tensor, None, None, None]:
        """The gradient of `parts`."""
        parts, normalisers = ctx.saved_tensors
        numbers = (_numbers(parts), _numbers(grads[0]), normalisers.numpy())
        return _tensor(_native.attend_back(*numbers, ctx.bounds, **ctx.about)), None, None, None


def _numbers(tensor: Tensor) -> NDArray[np.float32] | NDArray[np.uint16]:
    """A tensor as the binding takes it, which has no name for bfloat16 but its bits."""
    whole = tensor.detach().contiguous()
    found: NDArray[np.float32] | NDArray[np.uint16] = (
        whole.view(torch.uint16) if whole.dtype == torch.bfloat16 else whole
    ).numpy()
    return found


def _tensor(numbers: NDArray[np.float32] | NDArray[np.uint16]) -> Tensor:
    """The way back."""
    tensor = torch.from_numpy(numbers)
    return tensor.view(torch.bfloat16) if tensor.dtype == torch.uint16 else tensor


def _attend_repeated(attention: Any, parts: Tensor, rows: Rows, borrowed: NDArray[np.int64]) -> Tensor:
    """Attention with what rows borrow repeated in each of them. Tokens behind the last row get zeros."""
    bounds = rows.bounds.tolist()[: len(borrowed) + 1]
    places, own = [], []
    lent = 0
    for row, count in enumerate(borrowed.tolist()):
        lent = lent if count else bounds[row]
        places.append(np.concatenate((np.arange(lent, lent + count), np.arange(bounds[row], bounds[row + 1]))))
        own.append(np.arange(len(places[-1])) >= count)
    ends = torch.tensor([0, *map(len, places)]).cumsum(0).to(rows.bounds)
    blocks = [(1, len(place)) for place in places]
    whole = Rows(blocks, rows.kernel, ends, max(map(len, places)))
    index, kept = (torch.from_numpy(np.concatenate(part)).to(parts.device) for part in (places, own))
    mixed = attend(attention, parts[index], whole)[kept]
    return F.pad(mixed, (0, 0, 0, len(parts) - len(mixed)))


def _attend_rows(attention: Any, parts: Tensor, bounds: Tensor, longest: int) -> Tensor:
    """Attention within rows of any length, one behind the other, in one call of flash attention."""
    from torch.nn.attention.varlen import varlen_attn  # noqa: PLC0415  (a second to import, on a GPU alone)

    query, key, value = parts.view(len(parts), 3, attention.num_heads, -1).unbind(1)
    mixed = varlen_attn(
        query, key, value, bounds, bounds, longest, longest, scale=attention.scaling, window_size=(-1, 0)
    )
    return cast("Tensor", mixed).flatten(1)


def _attend_blocks(attention: Any, parts: Tensor, blocks: Blocks) -> Tensor:
    """Attention block by block. Rows behind the last block are no tokens: they only keep their place."""
    dtype = parts.dtype
    if parts.device.type == "cpu" and dtype == torch.bfloat16:
        parts = parts.float()  # SDPA's bfloat16 backward is slow on CPUs
    sizes = [rows * length for rows, length in blocks]
    *pieces, behind = torch.split(parts, [*sizes, len(parts) - sum(sizes)])
    mixed = [_attend_block(attention, piece, *block) for piece, block in zip(pieces, blocks, strict=True)]
    return torch.cat([*mixed, behind[:, : mixed[0].shape[1]]]).to(dtype)


def _attend_block(attention: Any, parts: Tensor, rows: int, length: int) -> Tensor:
    """Attention within one block: query, key and value (rows * length, 3 * width) to (rows * length, width)."""
    width = parts.shape[1] // 3
    heads = attention.num_heads
    query, key, value = parts.view(rows, length, 3, heads, width // heads).permute(2, 0, 3, 1, 4)
    dropout = attention.attn_dropout.p if attention.training else 0.0
    mixed = F.scaled_dot_product_attention(
        query, key, value, dropout_p=dropout, is_causal=True, scale=attention.scaling
    )
    return mixed.transpose(1, 2).reshape(rows * length, width)
