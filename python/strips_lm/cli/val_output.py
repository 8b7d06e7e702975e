"""Verdicts in the words of VAL, so that a tool that reads its output can read ours.

What VAL prints without options; its exit status (always 0) is not copied, which is 1 here where a plan is invalid.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, TextIO

if TYPE_CHECKING:
    from collections.abc import Iterable

    from strips_lm._native import Verdict
    from strips_lm.cli.validate import Submission

FAILURES = {"inapplicable": "\nPlan failed to execute\n", "goal_not_reached": "Goal not satisfied\nPlan invalid\n"}
"""What follows the plan's name; every other failure is a bad plan description."""


def write(results: Iterable[tuple[Submission, Verdict]], out: TextIO) -> int:
    """Prints each plan's verdict and then the lists of both kinds; 1 where one is not valid."""
    successful: dict[float, list[str]] = {}
    failed: list[str] = []
    for submission, verdict in results:
        out.write(f"Checking plan: {submission.file}\n")
        if verdict.outcome in ("valid", "goal_not_reached"):
            out.write("Plan executed successfully - checking goal\n")
        if verdict.cost is not None:
            successful.setdefault(verdict.cost, []).append(submission.file)
            out.write(f"Plan valid\nFinal value: {verdict.cost:.10g} \n")
        else:
            failed.append(submission.file)
            out.write(FAILURES.get(verdict.outcome, "Bad plan description!\n"))
    if successful:
        out.write("\nSuccessful plans:")
        for cost, files in sorted(successful.items()):
            out.write(f"\nValue: {cost:.10g}\n {' '.join(files)} ")
        out.write("\n")
    if failed:
        out.write(f"\n\nFailed plans:\n {' '.join(failed)} \n")
    return 1 if failed else 0
