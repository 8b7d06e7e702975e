"""Checks plans against a problem, and says of a wrong one which step fails and why.

A plan file holds one step a line, `(action argument …)`, in any case, with or without time stamps and durations;
comments begin with a semicolon. With --many a file holds many plans, separated by blank lines. `-` reads stdin.
"""

from __future__ import annotations

import json
import sys
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING

from strips_lm._native import split_plans
from strips_lm.cli.arguments import add_task, read_task

if TYPE_CHECKING:
    import argparse
    from collections.abc import Iterable, Iterator

    from strips_lm._native import Task, Verdict

BATCH = 1 << 14
"""Plans validated at a time."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Submission:
    """A plan to check: the file it came from, the lines before it there, its text."""

    file: str
    line_before: int
    text: str


def configure(parser: argparse.ArgumentParser) -> None:
    """Adds the command's arguments."""
    add_task(parser)
    parser.add_argument("plans", metavar="PLAN", nargs="+", help="plan files in IPC form")
    parser.add_argument("--many", action="store_true", help="each file holds many plans, separated by blank lines")
    form = parser.add_mutually_exclusive_group()
    form.add_argument("--json", action="store_true", help="print one JSON object a line")
    form.add_argument("--val", action="store_true", help="print what the validator VAL prints")


def run(args: argparse.Namespace) -> int:
    """Prints a verdict for each plan, in order; 1 where one is not valid."""
    results = _verdicts(read_task(args), _submissions(args.plans, many=args.many))
    if args.val:
        from strips_lm.cli.val_output import write  # noqa: PLC0415  (few ask for it)

        return write(results, sys.stdout)
    all_valid = True
    for submission, verdict in results:
        all_valid &= verdict.is_valid
        sys.stdout.write((_json_line if args.json else _sentence)(submission, verdict))
    return 0 if all_valid else 1


def _submissions(names: Iterable[str], *, many: bool) -> Iterator[Submission]:
    for name in names:
        data = sys.stdin.buffer.read() if name == "-" else Path(name).read_bytes()
        text = data.decode("utf-8", errors="replace")
        for line_before, plan in split_plans(text) if many else [(0, text)]:
            yield Submission(file=name, line_before=line_before, text=plan)


def _verdicts(task: Task, submissions: Iterator[Submission]) -> Iterator[tuple[Submission, Verdict]]:
    while batch := list(islice(submissions, BATCH)):
        yield from zip(batch, task.validate_many([submission.text for submission in batch]), strict=True)


def _line(submission: Submission, verdict: Verdict) -> int | None:
    return None if verdict.line is None else submission.line_before + verdict.line


def _json_line(submission: Submission, verdict: Verdict) -> str:
    table = {
        "plan": submission.file,
        "verdict": verdict.outcome,
        "step": verdict.step,
        "line": _line(submission, verdict),
        "missing": verdict.missing,
        "reason": verdict.reason,
    }
    return json.dumps(table, ensure_ascii=False, separators=(",", ":")) + "\n"


def _sentence(submission: Submission, verdict: Verdict) -> str:
    line = _line(submission, verdict)
    place = submission.file if line is None else f"{submission.file}:{line}"
    return f"{place}: {verdict.outcome}: {verdict.reason}\n"
