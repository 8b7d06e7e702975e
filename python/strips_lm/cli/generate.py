"""Have a model write a plan for a problem of your own, and the oracle check it.

Prints the plan in IPC form and, after a semicolon, the verdict: `valid` only if the plan was validated against the
problem's PDDL. On a terminal the steps come in colour with what each state changes. Exit 1 where the plan is not valid.
"""

from __future__ import annotations

import json
import sys
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any

from strips_lm import _native
from strips_lm.cli import explanation
from strips_lm.cli.arguments import UsageError, add_config, add_task, max_bytes, read_config
from strips_lm.config.sections import RERANKS
from strips_lm.trace import trace

if TYPE_CHECKING:
    import argparse
    from collections.abc import Sequence

    from strips_lm._native import Judgement
    from strips_lm.explain import Step
    from strips_lm.generate import Completion, Planner
    from strips_lm.guide import Tasks


def configure(parser: argparse.ArgumentParser) -> None:
    """Adds the command's arguments."""
    parser.add_argument("model", metavar="MODEL", help="a folder that `strips-lm train` wrote")
    add_task(parser)
    parser.add_argument(
        "--decode",
        default="greedy",
        metavar="NAME",
        help="greedy, sample, beam, best-of-k, replan, masked, masked-replan, search or search-replan",
    )
    chooser = "who chooses, for best-of-k (default: a head that judges steps, else replan, each step's likelihood anew)"
    parser.add_argument("--rerank", choices=RERANKS, help=chooser)
    fallback = "where the model comes to no plan, masked or by search, have the oracle's own search answer, and say so"
    parser.add_argument("--fallback", action="store_true", help=fallback)
    parser.add_argument("--style", choices=("typed", "paper"), default="typed", help="whether the prompt states types")
    parser.add_argument("--states", action="store_true", help="print each state in full after its step")
    explain = "for each step what the model would rather have said, what the oracle allows, and what went wrong"
    parser.add_argument("--explain", action="store_true", help=explain)
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    add_config(parser)


def run(args: argparse.Namespace) -> int:
    """Generates and checks one plan; returns 0 where it is valid, else 1."""
    question = Question(args)
    planner = question.planner(args)
    made = question.ask(planner, args.decode)
    judgement = question.judge([made.text])[0]
    valid = judgement.verdict.is_valid and made.finished
    steps = question.explain(planner, made) if args.explain else None
    if args.json:
        _print_json(question, made, judgement, valid, steps)
    else:
        _print_plan(question, made, judgement, valid, args.states)
        if steps is not None:
            explanation.show(steps, judgement)
    return 0 if valid else 1


class Question:
    """A problem as a model is asked it and as the oracle judges the answer."""

    def __init__(self, args: argparse.Namespace) -> None:
        """Reads the task; the prompt's words for actions are the domain's own."""
        self.domain = _native.Domain.parse(args.domain.read_bytes(), str(args.domain))
        problem = _native.Problem.parse(args.problem.read_bytes(), self.domain, str(args.problem))
        self.task = _native.Task(self.domain, problem, max_bytes=max_bytes(args), time_limit=args.time_limit)
        self.names = [name for name, _ in problem.objects]
        self.actions = [name for name, _ in self.domain.actions]
        self.prompt = _native.render_prompt(self.task, args.style, self.actions if args.style == "typed" else None)
        self.problem = problem.to_pddl()
        self.words = {**synonyms(self.domain.name), **{name: name for name in self.actions}}

    def judge(self, texts: Sequence[str]) -> list[Judgement]:
        """The oracle's judgements of completions."""
        many = len(texts)
        return _native.judge(self.domain, [self.problem] * many, list(texts), [self.words] * many)

    def planner(self, args: argparse.Namespace) -> Planner:
        """The model at work, with the configuration that the arguments describe."""
        args.overrides += [f"generate.rerank={args.rerank}"] if args.rerank else []
        args.overrides += ["generate.fallback=true"] if args.fallback else []
        config = read_config(args)
        from strips_lm.generate import GUIDED, Planner, check_decode  # noqa: PLC0415

        check_decode(args.decode)
        if args.fallback and args.decode not in GUIDED:
            raise UsageError("`--fallback` goes with `--decode masked` or `--decode search`")
        return Planner.load(args.model, config.generate, config.seed).for_domain(self.domain)

    def ask(self, planner: Planner, decode: str) -> Completion:
        """The model's completion."""

        def holds(_: Sequence[int], texts: Sequence[str]) -> list[bool]:
            return [judgement.verdict.is_valid for judgement in self.judge(texts)]

        return planner.complete([self.prompt], decode, holds, tasks=self.tasks()).completions[0]

    def explain(self, planner: Planner, made: Completion) -> list[Step]:
        """What the model would rather have said, and what the oracle allows."""
        from strips_lm.explain import explain  # noqa: PLC0415

        return explain(planner, self.prompt, made, self.tasks())

    def tasks(self) -> Tasks:
        """The oracle behind the prompt."""
        from strips_lm.guide import Tasks  # noqa: PLC0415

        def find(prompts: Sequence[int]) -> tuple[list[_native.Task], list[Sequence[str]]]:
            return [self.task] * len(prompts), [self.names] * len(prompts)

        return Tasks(self.domain, find)


def synonyms(domain: str) -> dict[str, str]:
    """The words for actions and predicates that models of a built-in domain may have been trained on."""
    from strips_lm.evaluate.suites import read_synonyms  # noqa: PLC0415

    return read_synonyms(Path(str(files("strips_lm") / "domains" / domain / "lexicon.toml")))


def _print_json(
    question: Question, made: Completion, judgement: Judgement, valid: bool, steps: Sequence[Step] | None
) -> None:
    found: dict[str, Any] = {
        "valid": valid,
        "plan": judgement.plan.splitlines(),
        **{key: value for key, value in judgement.verdict.to_dict().items() if key != "plan"},
        "finished": made.finished,
        "by_oracle": made.by_oracle,
        "prompt": question.prompt,
        "text": made.text,
        "states": judgement.states_total,
        "states_right": judgement.states_right,
    }
    if made.choices:
        share = made.removed / made.choices
        found |= {"choices": made.choices, "removed_share": share, "steps_cut": made.steps_cut}
    if steps is not None:
        found["steps"] = explanation.to_json(steps, judgement)
    print(json.dumps(found))


def _print_plan(question: Question, made: Completion, judgement: Judgement, valid: bool, states: bool) -> None:
    """The plan as a plan file, or on a terminal for people."""
    found, said, help_ = trace(question.prompt, made.text), sentence(made, judgement, valid), guidance(made)
    if sys.stdout.isatty():
        from strips_lm.cli import plan_view  # noqa: PLC0415

        plan_view.show(found, judgement, said, valid=valid, states=states)
        if help_:
            plan_view.note(help_)
        return
    for number, operator in enumerate(judgement.plan.splitlines()):
        print(operator)
        if states and number < len(found.steps):
            print(f"; {', '.join(found.steps[number].state or ())}")
    print(f"; {said}")
    if help_:
        print(f"; {help_}")


def guidance(made: Completion) -> str:
    """How much the oracle helped; nothing where it did not."""
    if not made.choices:
        return "the oracle's own search answers" if made.by_oracle else ""
    share, plural = 100 * made.removed / made.choices, "s" * (made.choices != 1)
    said = f"guided by the oracle: {made.choices} choice{plural}, the mask removed {share:.3g} % of the probability"
    if made.steps_cut:
        said += f", detours of {made.steps_cut} step{'s' * (made.steps_cut != 1)} cut out"
    return f"{said}; the model came to no plan, and the oracle's own search answers" if made.by_oracle else said


def sentence(made: Completion, judgement: Judgement, valid: bool) -> str:
    """The verdict in words."""
    verdict = judgement.verdict
    if valid:
        return f"valid: {judgement.steps} steps, checked against the problem"
    if verdict.is_valid and not made.finished:
        return "not valid: the text did not come to its end"
    return f"not valid: {verdict.reason}"
