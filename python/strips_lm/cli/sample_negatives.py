"""Have a model's own wrong plans serve as negatives for the second head.

Plans are drawn for training prompts (`generate.samples`, `top_k`, `top_p`), judged by the oracle, and the first wrong
one of each prompt is written to FILE. Train on with `strips-lm train DATA --out RUN --set train.own_negatives=FILE`.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

from strips_lm.cli.arguments import add_config, natural, read_config

if TYPE_CHECKING:
    import argparse


def configure(parser: argparse.ArgumentParser) -> None:
    """Adds the command's arguments."""
    parser.add_argument("model", metavar="MODEL", help="a folder that `strips-lm train` wrote")
    parser.add_argument("--data", required=True, metavar="DIR", help="the data set")
    parser.add_argument("--out", required=True, metavar="FILE", type=Path, help="the Parquet file to write")
    parser.add_argument("--limit", type=natural, default=2000, metavar="N", help="training prompts (0: all)")
    add_config(parser)


def run(args: argparse.Namespace) -> int:
    """Writes the file and prints how many there are; 1 where the model made no mistake."""
    from strips_lm.cli.progress import progress  # noqa: PLC0415
    from strips_lm.evaluate.suites import DataFolder  # noqa: PLC0415
    from strips_lm.generate import Planner  # noqa: PLC0415
    from strips_lm.own_negatives import write  # noqa: PLC0415
    from strips_lm.sample_negatives import sample_negatives  # noqa: PLC0415

    config = read_config(args)
    data = DataFolder(args.data)
    planner = Planner.load(args.model, config.generate, config.seed).for_domain(data.domain)
    with progress() as (_, tick):
        total = config.generate.samples * args.limit
        found = sample_negatives(planner, data, args.limit, lambda done: tick("samples", done, max(total, done)))
    if found:
        write(args.out, found)
    print(json.dumps({"negatives": len(found), "file": str(args.out) if found else None}))
    return 0 if found else 1
