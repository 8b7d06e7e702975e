"""Kills `gen-data` at random moments, many times, and compares what is there at last with a run that was never killed.

After each kill every file under a final name must be whole. Each run is a fork of this process, so that kills fall into
the work and not into imports; POSIX only.

    python benches/kills.py [--kills 100] [--seed 0]
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import random
import signal
import tempfile
import time
from pathlib import Path

from strips_lm.cli import main as strips_lm

SMALL = [
    "--pairs=1200",
    "--seed=7",
    "--jobs=2",
    "--set=data.suite_records=60",
    "--set=data.problems_per_template=12",
    "--set=data.random_problems=60",
    "--set=data.states_per_start=200",
    "--set=data.shard_records=50",
]


def started(out: Path) -> multiprocessing.process.BaseProcess:
    """A process that makes the data set in `out`."""
    run = multiprocessing.get_context("fork").Process(target=quiet, args=(out,))
    run.start()
    return run


def quiet(out: Path) -> None:
    """`gen-data`, its messages left out."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
    os._exit(strips_lm(["gen-data", f"--out={out}", *SMALL]))


def contents(folder: Path) -> dict[str, bytes]:
    """Every file but hidden ones."""
    files = (path for path in folder.rglob("*") if path.is_file() and not path.name.startswith("."))
    return {str(path.relative_to(folder)): path.read_bytes() for path in files}


def undone(out: Path, draw: random.Random) -> None:
    """Takes some shards away once they are all there, so that there is work left to be killed in."""
    shards = sorted(out.glob("data/*.parquet"))
    if (out / "manifest.json").exists() or len(shards) > 20:
        (out / "manifest.json").unlink(missing_ok=True)
        for path in draw.sample(shards, k=len(shards) - 2):
            path.unlink()


def main() -> None:
    """Prints how many kills were survived; raises where a file is not whole or differs."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kills", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args()
    draw, killed = random.Random(args.seed), 0
    with tempfile.TemporaryDirectory() as folder:
        whole, out = Path(folder) / "whole", Path(folder) / "killed"
        start = time.monotonic()
        started(whole).join()
        seconds = time.monotonic() - start
        wanted = contents(whole)
        while killed < args.kills:
            run = started(out)
            run.join(draw.uniform(0.0, seconds))
            if run.exitcode is None and run.pid is not None:
                os.kill(run.pid, signal.SIGKILL)
                killed += 1
            run.join()
            for name, text in contents(out).items():
                assert wanted[name] == text, f"{name} is not whole after kill {killed}"
            undone(out, draw)
        last = started(out)
        last.join()
        assert last.exitcode == 0
        assert contents(out) == wanted
    print(
        f"{killed} kills at random moments of {seconds:.1f} s: every file whole, the same {len(wanted)} files at last"
    )


if __name__ == "__main__":
    main()
