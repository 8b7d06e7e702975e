"""Arguments that several commands share, and what they stand for."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

from strips_lm._native import Domain, Problem, Task

if TYPE_CHECKING:
    import argparse

    from strips_lm.config import RunConfig


class UsageError(ValueError):
    """Arguments that contradict each other or the input."""


def add_task(parser: argparse.ArgumentParser) -> None:
    """The two PDDL files of a task, and the budgets for grounding and searching it."""
    parser.add_argument("domain", metavar="DOMAIN", type=Path, help="the domain's PDDL file")
    parser.add_argument("problem", metavar="PROBLEM", type=Path, help="the problem's PDDL file")
    limits = parser.add_argument_group("limits (exit code 3 where one is reached)")
    limits.add_argument("--time-limit", metavar="SECONDS", type=float, help="for grounding, and again for searching")
    limits.add_argument("--max-memory", metavar="MIB", type=positive, help="what the search may hold (default 4096)")


def read_task(args: argparse.Namespace) -> Task:
    """Reads and grounds the task; warnings go to stderr.

    Raises:
        OSError: a file cannot be read.
        PddlError: a file is not what it should be.
        LimitError: a budget was spent.
    """
    domain = Domain.parse(args.domain.read_bytes(), str(args.domain))
    problem = Problem.parse(args.problem.read_bytes(), domain, str(args.problem))
    for warning in [*domain.warnings, *problem.warnings]:
        sys.stderr.write(f"{warning}\n")
    return Task(domain, problem, max_bytes=max_bytes(args), time_limit=args.time_limit)


def max_bytes(args: argparse.Namespace) -> int | None:
    """`--max-memory` in bytes."""
    return args.max_memory << 20 if args.max_memory else None


def positive(text: str) -> int:
    """A whole number above zero."""
    number = int(text)
    if number < 1:
        raise ValueError(text)
    return number


def natural(text: str) -> int:
    """A whole number, zero included."""
    number = int(text)
    if number < 0:
        raise ValueError(text)
    return number


positive.__name__ = "positive whole number"
natural.__name__ = "whole number"


def add_config(parser: argparse.ArgumentParser, preset: str | None = None) -> None:
    """How a run is configured: a preset, and fields set on top of it."""
    parser.add_argument(
        "--preset", default=preset, metavar="NAME", help="a shipped preset, or a TOML file such as run.toml"
    )
    parser.add_argument(
        "--set", dest="overrides", action="append", default=[], metavar="SECTION.FIELD=VALUE", help="set one field"
    )


def read_config(args: argparse.Namespace) -> RunConfig:
    """The configuration that `add_config`'s arguments describe.

    Raises:
        ConfigError: it cannot be.
    """
    from strips_lm.config import RunConfig  # noqa: PLC0415  (only the commands that have one pay for it)

    return RunConfig.load(args.preset, args.overrides)
