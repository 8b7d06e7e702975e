"""Score models on suites: valid plans with 95 % intervals, perplexity, multiple choice, and why plans fail.

Table 1 goes to stdout and everything to `--json FILE` (docs/results-format.md). Every plan is checked by the oracle.
`--reproduce results.json` runs an evaluation again with its own settings and compares; exit 1 where anything differs.
"""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import argparse

    from strips_lm.evaluate.results import Results


def configure(parser: argparse.ArgumentParser) -> None:
    """Adds the command's arguments."""
    parser.add_argument("models", metavar="MODEL", nargs="*", help="folders that `strips-lm train` wrote")
    parser.add_argument("--data", metavar="DIR", help="the data set, or a mixture of several")
    parser.add_argument(
        "--suite",
        action="append",
        metavar="NAME",
        help="a suite (again for more; default: all eight, as far as they are there)",
    )
    own = "PDDL problems of the data set's domain as a suite (again for more); without `--suite` they are all"
    parser.add_argument("--problems", action="append", metavar="FOLDER", help=own)
    ways = "greedy, sample, beam, best-of-k, replan, masked, masked-replan, search or search-replan (again for more)"
    parser.add_argument("--decode", action="append", metavar="NAME", help=ways)
    parser.add_argument("--limit", type=int, metavar="N", help="prompts a suite (0: all)")
    parser.add_argument("--preset", metavar="NAME", help="a preset or TOML file to start from")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="a field of the configuration")
    parser.add_argument("--json", metavar="FILE", help="write the results here")
    parser.add_argument("--reproduce", metavar="FILE", help="run the evaluation of a results file again and compare")


def run(args: argparse.Namespace) -> int:
    """Evaluates; returns the exit code."""
    if args.reproduce:
        return _reproduce(args)
    results = _evaluate(args.models, args.data, args)
    show(results)
    return 0


def _evaluate(
    models: list[str], data: str | None, args: argparse.Namespace, overrides: list[str] | None = None
) -> Results:
    from strips_lm.cli.progress import progress  # noqa: PLC0415
    from strips_lm.config import ConfigError, RunConfig  # noqa: PLC0415

    if not models or not data:
        raise ConfigError("`evaluate` needs at least one MODEL and `--data DIR`")
    config = RunConfig.load(args.preset, [*_overrides(args), *(overrides or [])])
    with progress() as (tell, tick):
        from strips_lm.evaluate.evaluation import evaluate  # noqa: PLC0415

        results = evaluate(config, data, models, tell, tick)
        if config.evaluate.card:
            from strips_lm.evaluate.card import write_cards  # noqa: PLC0415

            write_cards(results)
    if args.json:
        results.save(args.json)
    return results


def _overrides(args: argparse.Namespace) -> list[str]:
    """The configuration's fields that have an option of their own, then the rest."""
    found = list(args.set)
    if args.suite:
        found.append(f"evaluate.suites={args.suite!r}")
    if args.problems:
        found.append(f"evaluate.problems={args.problems!r}")
        found += [] if args.suite else ["evaluate.suites=[]"]
    if args.decode:
        found.append(f"evaluate.decodes={args.decode!r}")
    if args.limit is not None:
        found.append(f"evaluate.limit={args.limit}")
    return found


def show(results: Results) -> None:
    """Prints Table 1 and what explains it."""
    from rich.console import Console  # noqa: PLC0415

    from strips_lm.evaluate import table  # noqa: PLC0415

    console = Console(width=None if sys.stdout.isatty() else 200)
    for part in table.tables(results):
        console.print(part)


def _reproduce(args: argparse.Namespace) -> int:
    """Runs an evaluation again with the settings in its results; 1 where anything but the timings differs."""
    from strips_lm.evaluate.results import Results, differences  # noqa: PLC0415

    old = Results.load(args.reproduce)
    models = args.models or [model.path for model in old.models]
    new = _evaluate(models, args.data or old.data, args, settings(old))
    found = differences(old, new)
    for line in found:
        print(line)
    print(f"{len(old.scores)} scores compared: {len(found)} differences")
    return 1 if found else 0


def settings(results: Results) -> list[str]:
    """The overrides that give a results file's configuration back."""
    import json  # noqa: PLC0415

    found = [f"seed={results.config['seed']}"]
    for section in ("generate", "evaluate"):
        found += [f"{section}.{key}={json.dumps(value)}" for key, value in results.config[section].items()]
    return found
