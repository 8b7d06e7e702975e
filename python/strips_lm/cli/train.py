"""Train a model on a data set: `best` and `last` checkpoints, `metrics.jsonl` and `run.toml` go to `--out`.

Without `--preset`, `tiny` is trained (`lstm` for `--model lstm`). `--resume` goes on from `last` with the settings of
the run's own `run.toml`. Ctrl-C and SIGTERM write a checkpoint first (exit 130 and 143). Exit 1 where the loss is no
longer a number.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import argparse

    from strips_lm.config import RunConfig


def configure(parser: argparse.ArgumentParser) -> None:
    """Adds the command's arguments."""
    parser.add_argument("data", metavar="DATA", help="the data set, a folder that `strips-lm gen-data` wrote")
    parser.add_argument("--out", metavar="DIR", required=True, help="the run's folder")
    parser.add_argument("--model", choices=("double-head", "lm-head", "lstm"), help="which model (`model.kind`)")
    parser.add_argument("--preset", metavar="NAME", help="a shipped preset, or a TOML file such as run.toml")
    parser.add_argument("--set", dest="overrides", action="append", default=[], metavar="KEY=VALUE", help="set a field")
    parser.add_argument("--resume", action="store_true", help="go on from the last checkpoint in `--out`")


def run(args: argparse.Namespace) -> int:
    """Trains; returns 0, or 128 and the number of the signal that ended it."""
    config = _config(args)
    from strips_lm.train import NotFiniteError, train  # noqa: PLC0415

    try:
        number = train(config, args.data, args.out, resumed=args.resume)
    except NotFiniteError as error:
        sys.stderr.write(f"error: {error}\n")
        return 1
    return 128 + number if number else 0


def _config(args: argparse.Namespace) -> RunConfig:
    from strips_lm.config import RunConfig  # noqa: PLC0415

    preset = args.preset or ("lstm" if args.model == "lstm" else "tiny")
    if args.resume and args.preset is None and (Path(args.out) / "run.toml").is_file():
        preset = str(Path(args.out) / "run.toml")
    kind = [f"model.kind={args.model}"] if args.model else []
    return RunConfig.load(preset, [*kind, *args.overrides])
