"""Turn results into one self-contained HTML page: table, charts, a state graph, outputs side by side.

RUN is a `results.json`, or a folder that holds one; of several, the scores are joined.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import argparse

    from strips_lm.evaluate.results import Results


def configure(parser: argparse.ArgumentParser) -> None:
    """Adds the command's arguments."""
    parser.add_argument("runs", metavar="RUN", nargs="+", help="results.json, or a folder with one")
    parser.add_argument("--out", metavar="FILE", default="report.html", help="the page (default: report.html)")


def run(args: argparse.Namespace) -> int:
    """Writes the page; returns the exit code."""
    from strips_lm.report import write_report  # noqa: PLC0415

    write_report(load(args.runs), args.out)
    print(args.out)
    return 0


def load(runs: list[str]) -> Results:
    """The results of all runs, joined in order."""
    from strips_lm.evaluate.results import Results  # noqa: PLC0415

    found = [Results.load(Path(run) / "results.json" if Path(run).is_dir() else run) for run in runs]
    for more in found[1:]:
        found[0].join(more)
    return found[0]
