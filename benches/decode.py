"""Greedy decoding: the static cache against `transformers.generate` at its best batch size, on the same prompts.

    python benches/decode.py MODEL DATA [--suite unseen-objects] [--limit 256]

Both sides use all cores (ours one thread a core, transformers one thread or all, whichever is faster), give the
same tokens (checked), and are timed in turns; the best of the rounds counts, as other work on the machine only slows.
CPU seconds are printed beside the wall clock's: on a busy machine they are the steadier measure.
"""

from __future__ import annotations

import argparse
import time
from typing import TYPE_CHECKING, Any

import torch

from strips_lm.config import RunConfig
from strips_lm.evaluate.suites import DataFolder
from strips_lm.generate import Planner

if TYPE_CHECKING:
    from collections.abc import Sequence


Times = tuple[float, float]
"""Seconds on the clock, and of CPU."""


def theirs(planner: Planner, ids: Sequence[Sequence[int]], batch: int, threads: int) -> tuple[Times, list[list[int]]]:
    """Times and tokens of `transformers.generate`, prompts sorted by length and padded on the left."""
    torch.set_num_threads(threads)
    end, limit = planner.tokenizer.end_id, planner.config.max_new
    order = sorted(range(len(ids)), key=lambda i: len(ids[i]))
    made: list[list[int]] = [[]] * len(ids)
    started, busy = time.perf_counter(), time.process_time()
    for start in range(0, len(order), batch):
        part = order[start : start + batch]
        longest = max(len(ids[i]) for i in part)
        padded = torch.tensor([[end] * (longest - len(ids[i])) + list(map(int, ids[i])) for i in part])
        mask = torch.tensor([[0] * (longest - len(ids[i])) + [1] * len(ids[i]) for i in part])
        room = min(limit, planner.model_context - longest)
        with torch.inference_mode():
            options: dict[str, Any] = {"do_sample": False, "max_new_tokens": room, "pad_token_id": end}
            found = planner.model.generate(padded, attention_mask=mask, **options)[:, longest:].tolist()
        for i, row in zip(part, found, strict=True):
            made[i] = row[: row.index(end) + 1] if end in row else row
    return (time.perf_counter() - started, time.process_time() - busy), made


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("model")
    parser.add_argument("data")
    parser.add_argument("--suite", default="unseen-objects")
    parser.add_argument("--limit", type=int, default=256)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--batch", type=int, nargs="+", default=[32, 64, 128, 256])
    args = parser.parse_args()
    planner = Planner.load(args.model, RunConfig.load().generate, device="cpu")
    prompts = [item.prompt for item in DataFolder(args.data).items(args.suite, args.limit)]
    ids, _ = planner.tokenizer.encode_prompts(prompts)
    cores = torch.get_num_threads()
    ours_best: Times = (float("inf"), float("inf"))
    peers: dict[tuple[int, int], Times] = {}
    for _ in range(args.rounds):
        busy = time.process_time()
        ours = planner.complete(prompts, "greedy")
        ours_best = least(ours_best, (ours.seconds, time.process_time() - busy))
        for batch in args.batch:
            for threads in sorted({1, cores}):
                times, made = theirs(planner, ids, batch, threads)
                peers[batch, threads] = least(peers.get((batch, threads), times), times)
    texts = planner.tokenizer.decode_completions(ids, made, planner.tokenizer.encode_prompts(prompts)[1])
    same = sum(c.text == text for c, text in zip(ours.completions, texts, strict=True))
    count = len(prompts)
    rates = f"{count / ours_best[0]:.0f} prompts/s, {ours.tokens / ours_best[0]:.0f} tokens/s"
    print(f"ours: {rates}, {ours_best[1]:.2f} CPU-s")
    for (batch, threads), times in sorted(peers.items()):
        speed = f"{count / times[0]:.0f} prompts/s, {times[1]:.2f} CPU-s"
        print(f"transformers, batch {batch}, {threads} threads: {speed}")
    wall, busy = (min(times[i] for times in peers.values()) / ours_best[i] for i in (0, 1))
    print(f"transformers / ours: {wall:.2f} by the clock, {busy:.2f} by CPU; {same} of {count} texts equal")


def least(a: Times, b: Times) -> Times:
    """The smaller of each."""
    return min(a[0], b[0]), min(a[1], b[1])


if __name__ == "__main__":
    main()
