"""The command line: data to stdout, progress to stderr, exit codes as scripts expect them.

Each command is one module of this package with two functions: `configure(parser)` adds its arguments, `run(args)`
does the work and gives the exit code. A command's module is imported only when it is called, and imports what is heavy
only inside `run`, so that `--help` answers at once and the oracle's commands work where torch is not installed.

argparse reads the arguments because it costs nothing to start (docs/decisions/0001-argparse.md).
"""

from __future__ import annotations

import argparse
import importlib
import os
import sys
from typing import TYPE_CHECKING, Protocol, cast

from strips_lm import __version__

if TYPE_CHECKING:
    from collections.abc import Sequence

COMMANDS = {
    "plans": "print or count all plans of a problem",
    "validate": "check plans against a problem, with the reason where one fails",
    "gen-data": "make a data set whose every label is proven",
    "show": "make one record of a data set anew",
    "verify-data": "prove a data set again from its files alone",
    "train": "train a model on a data set",
    "export": "write a trained model as a plain language model for other programs",
    "generate": "have a model write a plan for a problem, and the oracle check it",
    "evaluate": "score models on suites of problems",
    "report": "turn results into one HTML page",
    "demo": "a local web page on which a model plans step by step",
    "quickstart": "data set, models, scores and page with one command",
}
"""Every command's name and what it does, in the order of `--help`. The module is the name with `_` for `-`."""

EXIT_CODES = "exit codes: 0 done, 1 a negative result, 2 bad usage or input, 3 a limit was reached, 130 interrupted"


class Command(Protocol):
    """What a command's module offers."""

    def configure(self, parser: argparse.ArgumentParser) -> None:
        """Adds the command's arguments."""

    def run(self, args: argparse.Namespace) -> int:
        """Does the work; returns the exit code."""


class Parser(argparse.ArgumentParser):
    """An argument parser whose complaints are one sentence and a hint."""

    def error(self, message: str) -> None:  # type: ignore[override]
        """Reports bad usage and exits with 2."""
        hint = "" if "\nhint: " in message else f"\nhint: {self.prog} --help shows what is accepted"
        self.exit(2, f"error: {message}{hint}\n")


def entry() -> None:
    """Runs the console script and exits."""
    sys.exit(main(sys.argv[1:]))


def main(argv: Sequence[str]) -> int:
    """Runs the command line `argv` (without the program's name) and returns the exit code."""
    try:
        args, rest = _top_parser().parse_known_args(argv[:1])
        code = _run_command(args.command, [*rest, *argv[1:]])
        sys.stdout.flush()
    except SystemExit as exit_:
        return exit_.code if isinstance(exit_.code, int) else 0
    except BrokenPipeError:
        return _reader_left()
    except (Exception, KeyboardInterrupt) as error:
        from strips_lm.cli.errors import report  # noqa: PLC0415  (only a failure pays for it)

        return report(error)
    return code


def _top_parser() -> Parser:
    width = max(map(len, COMMANDS))
    listing = "\n".join(f"  {name:<{width}}  {summary}" for name, summary in COMMANDS.items())
    parser = Parser(
        prog="strips-lm",
        description="A complete STRIPS oracle, and language-model planners checked by it.",
        epilog=f"commands:\n{listing}\n\nstrips-lm COMMAND --help explains one of them\n{EXIT_CODES}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        usage="strips-lm COMMAND …",
    )
    parser.add_argument("--version", action="version", version=f"strips-lm {__version__}")
    parser.add_argument("command", metavar="COMMAND", type=_command_name, help="one of the commands below")
    return parser


def _command_name(name: str) -> str:
    if name in COMMANDS:
        return name
    from strips_lm.config.names import suggestion  # noqa: PLC0415

    raise argparse.ArgumentTypeError(f"no command {name!r}{suggestion(name, COMMANDS)}")


def _run_command(name: str, argv: Sequence[str]) -> int:
    command = cast("Command", importlib.import_module(f"strips_lm.cli.{name.replace('-', '_')}"))
    parser = Parser(
        prog=f"strips-lm {name}",
        description=command.__doc__,
        epilog=EXIT_CODES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    command.configure(parser)
    return command.run(parser.parse_args(argv))


def _reader_left() -> int:
    """Ends quietly where the program that read our output (`head`, say) has gone."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return 0
