"""Stops training at random steps and resumes it: the weights must end bit for bit where an uninterrupted run ends.

Every other stop is SIGTERM, which writes a checkpoint; the rest are crashes that write nothing, so that the run goes
back to its last periodic checkpoint. All three models, with dropout; exit 1 where any weight or moment differs.

    python benches/resume.py [--stops 20] [--steps 24] [--seed 0]
"""

from __future__ import annotations

import argparse
import contextlib
import os
import random
import signal
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

import torch
from safetensors.torch import load_file

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

import blocks_data
from strips_lm import train as loop
from strips_lm.checkpoint import CheckpointError
from strips_lm.config import RunConfig

if TYPE_CHECKING:
    from strips_lm.batches import Step

KINDS = ("double-head", "lm-head", "lstm")
NEXT = loop.Steps.next
"""The one place where a step begins."""


class CrashError(Exception):
    """A process that is gone; nothing of ours catches it."""


def config(kind: str, steps: int) -> RunConfig:
    small = ["model.layers=2", "model.width=32", "model.context=400", "tokenizer.kind=bpe", "tokenizer.vocab_size=320"]
    short = ["train.minutes=0", f"train.steps={steps}", "train.step_tokens=600", "train.position_offset=8"]
    heads = ["train.mc_start=0.0", "train.mc_share=0.5", "model.dropout=0.1", f"model.kind={kind}"]
    return RunConfig.load("tiny", [*small, *short, *heads, "train.save_minutes=0.005"])


def stop_at(step: int, crash: bool) -> None:
    """Makes the run end when that step (from 0) begins."""

    def stop_or_build(steps: loop.Steps, fraction: float) -> Step:
        if steps.run.progress.step == step:
            if crash:
                raise CrashError
            os.kill(os.getpid(), signal.SIGTERM)
        return NEXT(steps, fraction)

    loop.Steps.next = stop_or_build


def stopped_and_resumed(run: RunConfig, data: Path, out: Path, step: int, crash: bool) -> None:
    """One run in two parts; a crash before the first checkpoint starts anew."""
    stop_at(step, crash)
    with contextlib.suppress(CrashError):
        loop.train(run, data, out, shown=False)
    loop.Steps.next = NEXT
    try:
        loop.train(run, data, out, resumed=True, shown=False)
    except CheckpointError:
        loop.train(run, data, out, shown=False)


def same(one: Path, two: Path) -> bool:
    """Whether weights and optimiser are equal to the last bit."""
    for name in ("model.safetensors", "optimizer.safetensors"):
        first, second = load_file(one / "last" / name), load_file(two / "last" / name)
        if first.keys() != second.keys() or not all(torch.equal(first[key], second[key]) for key in first):
            return False
    return True


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--stops", type=int, default=20)
    parser.add_argument("--steps", type=int, default=24)
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args()
    torch.set_num_threads(1)
    rng, differing = random.Random(args.seed), 0
    with tempfile.TemporaryDirectory() as folder:
        data = blocks_data.write(Path(folder) / "data")
        for kind in KINDS:
            run, whole = config(kind, args.steps), Path(folder) / kind
            loop.train(run, data, whole, shown=False)
            for number in range(args.stops):
                step, crash, out = rng.randrange(args.steps), number % 2 == 1, Path(folder) / f"{kind}-{number}"
                stopped_and_resumed(run, data, out, step, crash)
                equal = same(whole, out)
                differing += not equal
                print(
                    kind, "crash" if crash else "SIGTERM", "at step", step, "same" if equal else "DIFFERENT", flush=True
                )
    return 1 if differing else 0


if __name__ == "__main__":
    sys.exit(main())
