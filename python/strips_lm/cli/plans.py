"""Prints all plans of a problem of at most T steps, counts them, or draws some.

Plans are printed in IPC form, a block each, blocks separated by a blank line; shorter plans first, then by the order of
their operators. Lines that begin with a semicolon are comments. Memory stays constant while plans are printed.
"""

from __future__ import annotations

import json
import os
import sys
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, TextIO

from strips_lm.cli.arguments import UsageError, add_task, max_bytes, natural, positive, read_task

if TYPE_CHECKING:
    import argparse
    from collections.abc import Iterator

    from strips_lm._native import PlanSet, Task

CHUNK = 1 << 16
"""Plans printed at a time."""


def configure(parser: argparse.ArgumentParser) -> None:
    """Adds the command's arguments."""
    add_task(parser)
    parser.add_argument("--max-steps", metavar="T", type=natural, default=7, help="the longest plan (default 7)")
    parser.add_argument(
        "--semantics",
        choices=["first-goal", "any", "simple"],
        default="first-goal",
        help="first-goal (default): plans end where they first reach the goal; any: they may pass through it before; "
        "simple: first-goal, and no state repeats",
    )
    what = parser.add_mutually_exclusive_group()
    what.add_argument("--count", action="store_true", help="print one JSON object with the exact count of each length")
    what.add_argument("--shortest", action="store_true", help="print one shortest plan")
    what.add_argument("--sample", metavar="K", type=positive, help="print K plans drawn uniformly")
    parser.add_argument("--seed", metavar="S", type=natural, default=0, help="the seed of --sample (default 0)")
    parser.add_argument("--distinct", action="store_true", help="draw no plan twice")
    parser.add_argument("--limit", metavar="N", type=positive, help="print at most N plans")
    parser.add_argument("--output", metavar="FILE", type=Path, help="write to FILE rather than to stdout")


def run(args: argparse.Namespace) -> int:
    """Prints what was asked for; 1 where there is no plan to print."""
    task = read_task(args)
    if args.shortest:
        return _print_shortest(task, args)
    plans = task.plan_set(args.max_steps, args.semantics, max_bytes=max_bytes(args), time_limit=args.time_limit)
    with _opened(args.output) as out:
        if args.count:
            out.write(_counts(plans, args))
            return 0
        return _print_blocks(_blocks(plans, args), args, out)


def _print_shortest(task: Task, args: argparse.Namespace) -> int:
    """Searches no further than the goal; the first of the shortest plans is the same for all semantics."""
    plan = task.shortest_plan(args.max_steps, max_bytes=max_bytes(args), time_limit=args.time_limit)
    with _opened(args.output) as out:
        return _print_blocks(iter([]) if plan is None else _block(plan), args, out)


def _block(plan: tuple[str, ...]) -> Iterator[str]:
    yield "".join(f"{step}\n" for step in plan) or "; empty plan\n"


def _counts(plans: PlanSet, args: argparse.Namespace) -> str:
    counts = plans.counts()
    table = {
        "max_steps": args.max_steps,
        "semantics": args.semantics,
        "counts": [str(count) for count in counts],
        "total": str(sum(counts)),
    }
    return json.dumps(table, separators=(",", ":")) + "\n"


def _print_blocks(blocks: Iterator[str], args: argparse.Namespace, out: TextIO) -> int:
    first = next(blocks, None)
    if first is None:
        sys.stderr.write(f"no plan of at most {args.max_steps} steps ({args.semantics})\n")
        return 1
    out.write(f"; {args.semantics} plans of at most {args.max_steps} steps\n{first}")
    for block in blocks:
        out.write(f"\n{block}")
    return 0


def _blocks(plans: PlanSet, args: argparse.Namespace) -> Iterator[str]:
    """The text to print, a piece at a time; nothing where there is no plan."""
    if args.sample is None or not plans:
        yield from _in_order(plans, args.limit)
        return
    if args.distinct and args.sample > plans.count():
        raise UsageError(f"--sample {args.sample} --distinct: there are {plans.count()} plans")
    yield plans.sample(min(args.sample, args.limit or args.sample), args.seed, replace=not args.distinct).text()


def _in_order(plans: PlanSet, limit: int | None) -> Iterator[str]:
    total = plans.count()
    end = total if limit is None else min(limit, total)
    for start in range(0, end, CHUNK):
        yield plans.text(start, min(start + CHUNK, end))
    if end < total:
        sys.stderr.write(f"stopped after {end} of {total} plans\n")


@contextmanager
def _opened(path: Path | None) -> Iterator[TextIO]:
    """Where to write: stdout, or a file that gets its name only when it is whole."""
    if path is None:
        yield sys.stdout
    elif path.exists() and not path.is_file():
        with path.open("w", encoding="utf-8") as out:
            yield out
    else:
        part = path.with_name(f"{path.name}.part{os.getpid()}")
        try:
            with part.open("w", encoding="utf-8") as out:
                yield out
            part.replace(path)
        finally:
            part.unlink(missing_ok=True)
