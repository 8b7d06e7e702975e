"""Makes one record of a data set anew, from `run.toml` and its index alone, and prints it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

from strips_lm.cli.arguments import natural

if TYPE_CHECKING:
    import argparse


def configure(parser: argparse.ArgumentParser) -> None:
    """Adds the command's arguments."""
    parser.add_argument("data", metavar="DIR", type=Path, help="the data set's folder")
    parser.add_argument("index", metavar="INDEX", type=natural, help="the record's index in its split")
    parser.add_argument("--split", default="train", metavar="NAME", help="the split (default: train)")
    parser.add_argument("--json", action="store_true", help="print one JSON object")


def run(args: argparse.Namespace) -> int:
    """Prints the record."""
    from strips_lm.config import ConfigError, RunConfig  # noqa: PLC0415
    from strips_lm.folders import one_data_set  # noqa: PLC0415
    from strips_lm.shards import table  # noqa: PLC0415
    from strips_lm.sources import read_kept  # noqa: PLC0415

    data = one_data_set(args.data)
    stream = read_kept(data).stream(RunConfig.load(data / "run.toml"))
    records = dict(stream.splits).get(args.split, 0)
    if args.index >= records:
        raise ConfigError(f"the split {args.split} has {records} records")
    (row,) = table(stream.batch(args.split, args.index, args.index + 1)).to_pylist()
    if args.json:
        print(json.dumps(row, ensure_ascii=False))
    else:
        for name, value in row.items():
            print(f"{name}: {' '.join(value) if isinstance(value, list) else value}")
    return 0
