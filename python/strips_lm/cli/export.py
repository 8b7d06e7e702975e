"""Write a trained model as a plain language model: `AutoModelForCausalLM` and other servers load it without a warning.

RUN is a run's folder (its best checkpoint) or a checkpoint's. The second head is left out; the tokenizer's files,
run.toml and the model card come along.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import argparse


def configure(parser: argparse.ArgumentParser) -> None:
    """Adds the command's arguments."""
    parser.add_argument("run", metavar="RUN", help="a folder that `strips-lm train` wrote")
    parser.add_argument("--out", metavar="DIR", required=True, help="the folder to write")


def run(args: argparse.Namespace) -> int:
    """Writes the model; returns the exit code."""
    from strips_lm.model import export_lm  # noqa: PLC0415

    if Path(args.out).exists() and any(Path(args.out).iterdir()):
        raise FileExistsError(17, "exists and is not empty", args.out)
    export_lm(args.run, args.out)
    print(args.out)
    return 0
