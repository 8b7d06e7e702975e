"""Attention of the training pass on a CPU against PyTorch's, forward and both ways, in one run.

PyTorch's is `scaled_dot_product_attention` in float32 on bfloat16 layers, with the casts that this takes, its faster
type on CPUs; ours is what `strips_lm.attention` calls. Rows are of one length, so that neither pads.

    python benches/attention.py [--rounds 60]        # OMP_NUM_THREADS=1 on a machine that others use too
"""

from __future__ import annotations

import argparse
import json
import time
from functools import partial
from types import SimpleNamespace
from typing import TYPE_CHECKING

import torch
from torch.nn import functional as F

from strips_lm.attention import Rows, attend

if TYPE_CHECKING:
    from collections.abc import Callable

SHAPES = ((8, 118, 4, 32), (16, 80, 4, 32), (5, 180, 4, 32), (2, 400, 4, 32), (8, 118, 6, 64), (2, 1000, 12, 64))
"""Rows, tokens of each, heads, numbers in a head: `tiny`, `small` and `gpt2`."""


def fused(parts: torch.Tensor, rows: int, heads: int) -> torch.Tensor:
    """(tokens, width) of (tokens, 3 * width) by PyTorch."""
    query, key, value = parts.float().view(rows, len(parts) // rows, 3, heads, -1).permute(2, 0, 3, 1, 4)
    mixed = F.scaled_dot_product_attention(query, key, value, is_causal=True)
    return mixed.transpose(1, 2).reshape(len(parts), -1).to(parts.dtype)


def both(way: Callable[[], torch.Tensor], grads: torch.Tensor) -> None:
    """Forward and backward."""
    way().backward(grads)


def milliseconds(work: Callable[[], object], rounds: int) -> float:
    """The least of some rounds."""
    times = []
    for _ in range(rounds + 5):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return 1e3 * min(times[5:])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=60)
    args = parser.parse_args()
    torch.manual_seed(0)
    for rows, length, heads, size in SHAPES:
        layer = SimpleNamespace(num_heads=heads, scaling=size**-0.5, training=False)
        of = SimpleNamespace(config=SimpleNamespace(attn_pdrop=0.0), training=False)
        parts = torch.randn(rows * length, 3 * heads * size).bfloat16().requires_grad_()
        grads = torch.randn(rows * length, heads * size).bfloat16()
        laid = Rows.of(of, parts, [(rows, length)])
        ways = {"pytorch": partial(fused, parts, rows, heads), "ours": partial(attend, layer, parts, laid)}
        line: dict[str, object] = {"rows": rows, "length": length, "heads": heads, "size": size}
        for name, way in ways.items():
            with torch.no_grad():
                line[f"{name}_forward_ms"] = milliseconds(way, args.rounds)
            line[f"{name}_both_ms"] = milliseconds(partial(both, way, grads), args.rounds)
        line["ratio_both"] = line["pytorch_both_ms"] / line["ours_both_ms"]
        print(json.dumps(line), flush=True)


if __name__ == "__main__":
    main()
