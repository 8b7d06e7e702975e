"""Proves a data set again from its files alone: hashes, positives, negatives, duplicates, what suites hold out.

Exit code 1, and the records at fault on stdout, where something is wrong.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import argparse


def configure(parser: argparse.ArgumentParser) -> None:
    """Adds the command's arguments."""
    parser.add_argument("data", metavar="DIR", type=Path, help="the data set's folder")


def run(args: argparse.Namespace) -> int:
    """Prints what is wrong; says on stderr what was checked."""
    from strips_lm.verify import verify  # noqa: PLC0415  (pyarrow is for this command alone)

    start = time.monotonic()
    result = verify(args.data, _tick if sys.stderr.isatty() else lambda _: None)
    for fault in result.faults:
        print(fault)
    rate = 60 * result.records / max(time.monotonic() - start, 1e-3)
    verdict = "faults found" if result.faults else "all of it holds"
    again = "" if result.made_again else " (made by another version: not compared with what run.toml gives)"
    sys.stderr.write(f"{args.data}: {result.records:,} records checked, {rate:,.0f} a minute: {verdict}{again}\n")
    return 1 if result.faults else 0


def _tick(records: int) -> None:
    sys.stderr.write(f"\r\x1b[K{records:,} records\r")
    sys.stderr.flush()
