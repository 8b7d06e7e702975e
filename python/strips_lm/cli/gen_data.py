"""Makes a data set of prompts, plans and negatives, each label proven by the oracle.

Run again on the same folder, it goes on where it stopped; the result has the same bytes for any number of jobs.
"""

from __future__ import annotations

import dataclasses
import sys
import time
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from strips_lm.cli.arguments import add_config, natural, positive, read_config

if TYPE_CHECKING:
    import argparse
    from collections.abc import Iterator

    from strips_lm.config import RunConfig


def configure(parser: argparse.ArgumentParser) -> None:
    """Adds the command's arguments."""
    parser.add_argument(
        "--out", metavar="DIR|URL", required=True, help="the data set's folder, or a URL (`s3://…`) for fsspec"
    )
    domains = "a built-in domain, a folder like one, a PDDL file, or `all`: a data set of each built-in domain"
    parser.add_argument("--domain", metavar="NAME|DIR|FILE", help=domains)
    parser.add_argument(
        "--problems", metavar="GLOB", nargs="+", action="extend", default=[], help="problems of your own"
    )
    parser.add_argument(
        "--random-goals",
        action="store_true",
        default=None,
        help="draw goals from states within reach of --problems, too",
    )
    parser.add_argument("--pairs", metavar="N", type=positive, help="records of training and validation together")
    parser.add_argument("--max-steps", metavar="T", type=positive, help="the longest plan (default 7)")
    parser.add_argument("--seed", metavar="S", type=natural, help="seed of every draw (default 0)")
    parser.add_argument("--format", choices=["parquet", "jsonl"], help="how records are written")
    parser.add_argument(
        "--jobs", metavar="N", type=natural, default=0, help="threads (default: one a core; of a cluster's task: one)"
    )
    parser.add_argument(
        "--cluster",
        choices=["ray"],
        help="make the records on the Ray cluster at RAY_ADDRESS, or on one of this machine",
    )
    add_config(parser)


def run(args: argparse.Namespace) -> int:
    """Writes the data set, or those of a mixture."""
    from strips_lm.mixture import write_mixture  # noqa: PLC0415
    from strips_lm.shards import write_data_set  # noqa: PLC0415  (pyarrow is for this command alone)
    from strips_lm.sources import ALL, read_sources  # noqa: PLC0415

    config = _config(args)
    progress = Progress()
    with _workers(args) as settings:
        if config.data.domain == ALL:
            wrote = write_mixture(args.out, config, tick=progress.tick, warn=progress.say, **settings)
        else:
            sources = read_sources(config.data.domain, config.data.problems)
            wrote = write_data_set(args.out, config, sources, tick=progress.tick, warn=progress.say, **settings)
    progress.say(f"{args.out}: {'written' if wrote else 'is finished already'}")
    return 0


@contextmanager
def _workers(args: argparse.Namespace) -> Iterator[dict[str, Any]]:
    """How `write_data_set` is to make the shards."""
    if args.cluster is None:
        yield {"jobs": args.jobs}
        return
    from strips_lm.cluster import ray_cluster  # noqa: PLC0415  (Ray is for those who ask for it)

    with ray_cluster(args.jobs or 1) as make_shards:
        yield {"make_shards": make_shards}


def _config(args: argparse.Namespace) -> RunConfig:
    """The configuration, with the arguments that have a field of their own put on top."""
    from strips_lm.sources import fitting  # noqa: PLC0415

    config = read_config(args)
    given = {name: getattr(args, name) for name in ("domain", "pairs", "max_steps", "random_goals", "format")}
    if args.problems:
        given["problems"] = tuple(args.problems)
    data = dataclasses.replace(config.data, **{name: value for name, value in given.items() if value is not None})
    seed = config.seed if args.seed is None else args.seed
    return dataclasses.replace(config, seed=seed, data=fitting(data))


class Progress:
    """A line on a terminal's stderr: records so far, rate, time left."""

    def __init__(self) -> None:
        self._shown = sys.stderr.isatty()
        self._start = time.monotonic()

    def tick(self, what: str, done: int, total: int) -> None:
        """Shows that `done` of `total` are there."""
        if what == "problems":
            self._write("solving problems …")
            self._start = time.monotonic()
            return
        seconds = max(time.monotonic() - self._start, 1e-3)
        rate = done / seconds
        left = (total - done) / rate if rate else 0.0
        filled = 30 * done // max(total, 1)
        self._write(
            f"[{'█' * filled}{'·' * (30 - filled)}] {done:,}/{total:,} records, {rate:,.0f}/s, {left:.0f} s left"
        )

    def say(self, line: str) -> None:
        """Writes a line that stays."""
        self._write("")
        sys.stderr.write(f"{line}\n")

    def _write(self, text: str) -> None:
        if self._shown:
            sys.stderr.write(f"\r\x1b[K{text}")
            sys.stderr.flush()
