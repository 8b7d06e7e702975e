"""Made-up results, for tests of what reads them. No number here was measured."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

from strips_lm.evaluate.results import Example, Likelihood, Model, Output, Results, Score
from strips_lm.evaluate.statistics import wilson

if TYPE_CHECKING:
    from pathlib import Path

SUITES = ("seen", "unseen-objects", "more-objects")
PROBLEM = """(define (problem tea) (:domain manipulation) (:objects shelf - fixture teabag - movable cup - vessel)
  (:init (inworkspace table) (inworkspace teabag) (inworkspace cup) (on teabag shelf) (on cup shelf))
  (:goal (and (on teabag cup) (on cup table) (opened cup))))"""
PLAN = "(pick cup)\n(place cup table)\n(open cup)\n(pick teabag)\n(place teabag cup)"
PROMPT = (
    "<|startoftext|> <GOAL> on(teabag, cup), on(cup, table), opened(cup) "
    "<INIT> inworkspace(table), inworkspace(teabag), inworkspace(cup), on(teabag, shelf), on(cup, shelf)"
)
TEXT = (
    "<ACTION> pick(cup) <STATE> inhand(cup), inworkspace(table), inworkspace(teabag), inworkspace(cup), "
    "on(teabag, shelf) <ACTION> place(cup, table) <STATE> inworkspace(table), inworkspace(teabag), "
    "inworkspace(cup), on(teabag, shelf), on(cup, table) <|endoftext|>"
)


def score(model: str, suite: str, valid: int, decode: str = "greedy") -> Score:
    low, high = wilson(valid, 200)
    wrong = 200 - valid
    return Score(
        model=model,
        suite=suite,
        decode=decode,
        oracle_helps=decode in ("masked", "search") or decode.endswith("oracle"),
        prompts=200,
        valid=valid,
        valid_low=low,
        valid_high=high,
        optimal=valid // 2,
        surplus_mean=0.5,
        executable_share=0.9,
        states=900,
        states_right=880,
        traces_right=valid,
        unfinished=2,
        malformed=1,
        verdicts={"valid": valid, "goal_not_reached": wrong // 2, "inapplicable": wrong - wrong // 2},
        failed_at={"3": wrong},
        by_length={"2": [valid // 2, 100], "5": [valid - valid // 2, 100]},
        tokens=9000,
        seconds=1.5,
        prompts_per_second=133.0,
        tokens_per_second=6000.0,
        verify_seconds=0.01,
        digest="0" * 64,
    )


def likelihood(model: str, suite: str) -> Likelihood:
    return Likelihood(
        model=model,
        suite=suite,
        records=500,
        left_out=0,
        tokens=30_000,
        perplexity=1.0312,
        floor=1.02,
        bits_per_plan=2.5,
        floor_bits_per_plan=1.9,
        choices=500,
        choices_right=495,
        by_negative={"drop-step": [245, 250], "shuffle-states": [250, 250]},
    )


def output(model: str, verdict: str) -> Output:
    reason = "" if verdict == "valid" else "the goal is not reached: (on teabag cup) is missing"
    plan = PLAN if verdict == "valid" else "(pick cup)\n(place cup table)"
    step = None if verdict == "valid" else 3
    probabilities = [0.99 - 0.1 * number for number in range(plan.count("\n") + 1)]
    return Output(
        model=model,
        decode="greedy",
        text=TEXT,
        plan=plan,
        verdict=verdict,
        step=step,
        reason=reason,
        finished=True,
        operator_probabilities=probabilities,
        state_probabilities=[1.0] * len(probabilities),
        end_probability=0.9,
    )


def write_metrics(folder: Path, level: float) -> None:
    folder.mkdir(parents=True)
    rows = [{"kind": "train", "step": s, "lm_loss": level * 0.97**s} for s in range(0, 100, 10)]
    rows += [
        {"kind": "validation", "step": s, "lm_loss": 1.1 * level * 0.97**s, "floor": 0.02} for s in range(0, 100, 30)
    ]
    (folder / "metrics.jsonl").write_text("".join(json.dumps(row) + "\n" for row in rows))


def made_up_results(folder: Path) -> Results:
    """Two models on three suites, with a data folder that holds only a domain."""
    from importlib.resources import files

    data = folder / "data"
    data.mkdir(parents=True)
    domain = (files("strips_lm") / "domains" / "manipulation" / "domain.pddl").read_text(encoding="utf-8")
    (data / "domain.pddl").write_text(domain)
    results = Results(data=str(data), config={"seed": 0, "generate": {}, "evaluate": {}}, created="2026-01-01")
    for index, model in enumerate(("double-head", "lstm")):
        write_metrics(folder / model, 2.0 + index)
        results.models.append(
            Model(name=model, path=str(folder / model), kind=model, tokenizer="canonical", parameters=900_000)
        )
        for suite, valid in zip(SUITES, (196, 190 - 150 * index, 120 - 118 * index), strict=True):
            results.scores.append(score(model, suite, valid))
            results.likelihoods.append(likelihood(model, suite))
    results.scores.append(score("double-head", "seen", 199, "best-of-8 by oracle"))
    outputs = [output("double-head", "valid"), output("lstm", "goal_not_reached")]
    example = Example(suite="unseen-objects", index=0, prompt=PROMPT, problem=PROBLEM, reference=PLAN, outputs=outputs)
    results.examples.append(example)
    return results
