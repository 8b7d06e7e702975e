"""Make a data set, train the report's three models and one on spelled names, score them, draw a page.

Leaves in the folder the data set, the checkpoints, `results.json` and `report.html`; prints Table 1. Called again after
Ctrl-C it goes on where it stopped. `--minutes` is the time for training; the rest takes a few minutes more.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from strips_lm.cli.arguments import natural, positive

if TYPE_CHECKING:
    import argparse


def configure(parser: argparse.ArgumentParser) -> None:
    """Adds the command's arguments."""
    parser.add_argument("--out", metavar="DIR", type=Path, default=Path("quickstart"), help="default: quickstart")
    parser.add_argument("--minutes", metavar="M", type=float, default=13.0, help="of training in all (default 13)")
    parser.add_argument(
        "--data-pairs", metavar="N", type=positive, default=0, help="pairs of the data set (default: its preset's)"
    )
    parser.add_argument("--limit", metavar="N", type=positive, default=300, help="prompts a suite (default 300)")
    parser.add_argument("--seed", metavar="S", type=natural, default=0, help="seed of every draw (default 0)")


def run(args: argparse.Namespace) -> int:
    """Runs all stages; returns the exit code."""
    from strips_lm.cli.evaluate import show  # noqa: PLC0415
    from strips_lm.cli.progress import progress  # noqa: PLC0415
    from strips_lm.quickstart import Quickstart  # noqa: PLC0415

    with progress() as (tell, tick):
        quickstart = Quickstart(
            out=args.out,
            minutes=args.minutes,
            pairs=args.data_pairs,
            limit=args.limit,
            seed=args.seed,
            tell=tell,
            tick=tick,
        )
        results = quickstart.run()
    show(results)
    return 0
