"""Greedy decoding: the static cache against `transformers.generate` at its best batch size, on the same prompts.

    python benches/decode.py MODEL DATA [--suite unseen-objects] [--limit 256]

Both sides use all cores (ours one thread a core, transformers one thread or all, whichever is faster), give the
same tokens (checked), and are timed in turns; the best of the rounds counts, as other work on the machine only slows.
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


def theirs(planner: Planner, ids: Sequence[Sequence[int]], batch: int, threads: int) -> tuple[float, list[list[int]]]:
    """Seconds and tokens of `transformers.generate`, prompts sorted by length and padded on the left."""
    torch.set_num_threads(threads)
    end, limit = planner.tokenizer.end_id, planner.config.max_new
    order = sorted(range(len(ids)), key=lambda i: len(ids[i]))
    made: list[list[int]] = [[]] * len(ids)
    started = time.perf_counter()
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
    return time.perf_counter() - started, made


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("model")
    parser.add_argument("data")
    parser.add_argument("--suite", default="unseen-objects")
    parser.add_argument("--limit", type=int, default=256)
    parser.add_argument("--rounds", type=int, default=3)
    args = parser.parse_args()
    planner = Planner.load(args.model, RunConfig.load().generate, device="cpu")
    prompts = [item.prompt for item in DataFolder(args.data).items(args.suite, args.limit)]
    ids, _ = planner.tokenizer.encode_prompts(prompts)
    cores = torch.get_num_threads()
    ours_best, peers = float("inf"), {}
    for _ in range(args.rounds):
        ours = planner.complete(prompts, "greedy")
        ours_best = min(ours_best, ours.seconds)
        for batch in (32, 64, 128, 256):
            for threads in sorted({1, cores}):
                seconds, made = theirs(planner, ids, batch, threads)
                peers[batch, threads] = min(peers.get((batch, threads), float("inf")), seconds)
    texts = planner.tokenizer.decode_completions(ids, made, planner.tokenizer.encode_prompts(prompts)[1])
    same = sum(c.text == text for c, text in zip(ours.completions, texts, strict=True))
    (batch, threads), seconds = min(peers.items(), key=lambda item: item[1])
    print(f"ours: {len(prompts) / ours_best:.0f} prompts/s, {ours.tokens / ours_best:.0f} tokens/s")
    print(f"transformers, batch {batch}, {threads} threads: {len(prompts) / seconds:.0f} prompts/s")
    print(f"ratio {seconds / ours_best:.2f}; {same} of {len(prompts)} texts equal")


if __name__ == "__main__":
    main()
