"""Greedy and masked decoding against `transformers.generate` at its best batch size, on the same prompts.

    python benches/decode.py MODEL DATA [--suite unseen-objects] [--limit 256]

It also prints what part of masked decoding the mask itself takes, and what part of greedy decoding verification is.

Both sides use all cores (ours one thread a core, transformers one thread or all, whichever is faster), give the
same tokens (checked), and are timed in turns; the best of the rounds counts, as other work on the machine only slows.
CPU seconds are printed beside the wall clock's: on a busy machine they are the steadier measure.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import torch

from strips_lm.config import RunConfig
from strips_lm.evaluate.suite import Suite
from strips_lm.evaluate.suites import DataFolder
from strips_lm.generate import Planner
from strips_lm.guide import OracleGuide

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence


Times = tuple[float, float]
"""Seconds on the clock, and of CPU."""

NEVER: Times = (float("inf"), float("inf"))


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
    data = DataFolder(args.data)
    suite = Suite.open(data, args.suite, args.limit)
    prompts = [item.prompt for item in suite.items]
    ids, _ = planner.tokenizer.encode_prompts(prompts)
    cores = torch.get_num_threads()
    busy = time.process_time()
    suite.prepare(data.domain)
    prepared = time.process_time() - busy
    ours_best = masked_best = verify_best = NEVER
    peers: dict[tuple[int, int], Times] = {}
    for _ in range(args.rounds):
        busy = time.process_time()
        ours = planner.complete(prompts, "greedy")
        ours_best = least(ours_best, (ours.seconds, time.process_time() - busy))
        started, busy = time.perf_counter(), time.process_time()
        suite.judge(data.domain, range(len(prompts)), [c.text for c in ours.completions])
        verify_best = least(verify_best, (time.perf_counter() - started, time.process_time() - busy))
        busy = time.process_time()
        masked = planner.complete(prompts, "masked", tasks=suite.oracle(data.domain))
        masked_best = least(masked_best, (masked.seconds, time.process_time() - busy))
        for batch in args.batch:
            for threads in sorted({1, cores}):
                times, made = theirs(planner, ids, batch, threads)
                peers[batch, threads] = least(peers.get((batch, threads), times), times)
    texts = planner.tokenizer.decode_completions(ids, made, planner.tokenizer.encode_prompts(prompts)[1])
    same = sum(c.text == text for c, text in zip(ours.completions, texts, strict=True))
    count = len(prompts)
    for name, made_by_us, best in (("greedy", ours, ours_best), ("masked", masked, masked_best)):
        rates = f"{count / best[0]:.0f} prompts/s, {made_by_us.tokens / best[0]:.0f} tokens/s"
        print(f"ours, {name}: {rates}, {best[1]:.2f} CPU-s")
    for (batch, threads), times in sorted(peers.items()):
        speed = f"{count / times[0]:.0f} prompts/s, {times[1]:.2f} CPU-s"
        print(f"transformers, batch {batch}, {threads} threads: {speed}")
    for name, best in (("greedy", ours_best), ("masked", masked_best)):
        wall, busy = (min(times[i] for times in peers.values()) / best[i] for i in (0, 1))
        print(f"transformers / ours, {name}: {wall:.2f} by the clock, {busy:.2f} by CPU")
    print(f"{same} of {count} greedy texts equal")
    shares = [100 * seconds / ours_best[1] for seconds in (verify_best[1], prepared)]
    print(
        f"verification / greedy, by CPU: {shares[0]:.1f} %, and {shares[1]:.1f} % once, to read and ground the problems"
    )
    print(f"mask / masked decoding: {100 * mask_share(planner, suite, data):.1f} % of one thread's time")


def mask_share(planner: Planner, suite: Suite, data: DataFolder) -> float:
    """The part of masked decoding, on one thread, that is spent in the oracle: grounding, masks, successors, states."""
    spent = 0.0
    began = time.thread_time()

    def timed(call: Callable[..., Any]) -> Callable[..., Any]:
        def run(*args: Any) -> Any:
            nonlocal spent
            start = time.thread_time()
            found = call(*args)
            spent += time.thread_time() - start
            return found

        return run

    methods = ("add", "mask", "advance", "is_open", "remove")
    before = {name: getattr(OracleGuide, name) for name in methods}
    single = Planner(planner.model, planner.tokenizer, replace(planner.config, workers=1))
    torch.set_num_threads(1)
    try:
        for name in methods:
            setattr(OracleGuide, name, timed(before[name]))
        single.complete([item.prompt for item in suite.items], "masked", tasks=suite.oracle(data.domain))
    finally:
        for name in methods:
            setattr(OracleGuide, name, before[name])
    return spent / (time.thread_time() - began)


def least(a: Times, b: Times) -> Times:
    """The smaller of each."""
    return min(a[0], b[0]), min(a[1], b[1])


if __name__ == "__main__":
    main()
