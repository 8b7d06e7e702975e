"""Validation from Python against pyperplan, pymimir and unified-planning, on the same plans, in one run, as ratios.

    uv run --with pymimir --with pyperplan --with unified-planning python benches/peers/validate.py

The plans are drawn from the plan set of gripper with four balls (``--max-steps`` 13), a quarter of them spoiled. This
project validates them from text, as operator ids, and with a full verdict each; pyperplan and pymimir, which have no
validator, run the obvious loop: look the operator up by name, test it, apply it, test the goal. Reading text is left
out for the peers. Each system must give the same verdicts. Times are processor time of the process, so that a busy
machine does not blur them; plans a second are for one core. Prints a JSON object a system to stdout, a table to stderr.
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import logging
import sys
import tempfile
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from strips_lm import Domain, Problem, Task

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

TOP = Path(__file__).resolve().parents[2]
DOMAIN = TOP / "python/strips_lm/domains/gripper/domain.pddl"
PROBLEM = """\
(define (problem four-balls) (:domain gripper)
  (:objects r0 r1 - room b0 b1 b2 b3 - ball left right - gripper)
  (:init (robot-in r0) (free left) (free right) (in b0 r0) (in b1 r0) (in b2 r0) (in b3 r0))
  (:goal (and (in b0 r1) (in b1 r1) (in b2 r1) (in b3 r1))))
"""
Plan = list[str]


def pyperplan(domain: Path, problem: Path) -> Callable[[Sequence[Plan]], list[bool]]:
    """The loop over pyperplan's operators."""
    from pyperplan.grounding import ground
    from pyperplan.pddl.parser import Parser

    logging.disable()
    parser = Parser(str(domain), str(problem))
    task = ground(parser.parse_problem(parser.parse_domain()), remove_irrelevant_operators=False)
    operators = {operator.name: operator for operator in task.operators}

    def is_valid(plan: Plan) -> bool:
        state = task.initial_state
        for step in plan:
            operator = operators.get(step)
            if operator is None or not operator.applicable(state):
                return False
            state = operator.apply(state)
        return bool(task.goals <= state)

    return lambda plans: [is_valid(plan) for plan in plans]


def pymimir(domain: Path, problem: Path) -> Callable[[Sequence[Plan]], list[bool]]:
    """The loop over pymimir's ground actions."""
    import pymimir

    task = pymimir.Problem(pymimir.Domain(domain), problem)
    objects, goal = {item.get_name(): item for item in task.get_objects()}, task.get_goal_condition()
    actions = {action.get_name(): action for action in task.get_domain().get_actions()}
    ground: dict[str, Any] = {}

    def action_of(step: str) -> Any:
        if step not in ground:
            name, *arguments = step[1:-1].split()
            ground[step] = task.new_ground_action(actions[name], [objects[argument] for argument in arguments])
        return ground[step]

    def is_valid(plan: Plan) -> bool:
        state = task.get_initial_state()
        for step in plan:
            action = action_of(step)
            if not action.is_applicable(state):
                return False
            state = action.apply(state)
        return bool(goal.holds(state))

    return lambda plans: [is_valid(plan) for plan in plans]


def unified_planning(domain: Path, problem: Path) -> Callable[[Sequence[Plan]], list[bool]]:
    """unified-planning's own validator."""
    import unified_planning.shortcuts as up
    from unified_planning.engines import SequentialPlanValidator, ValidationResultStatus
    from unified_planning.io import PDDLReader
    from unified_planning.plans import ActionInstance, SequentialPlan

    up.get_environment().credits_stream = None
    task = PDDLReader().parse_problem(str(domain), str(problem))
    validator = SequentialPlanValidator()

    def step_of(step: str) -> ActionInstance:
        name, *arguments = step[1:-1].split()
        return ActionInstance(task.action(name), tuple(up.ObjectExp(task.object(word)) for word in arguments))

    def is_valid(plan: Plan) -> bool:
        result = validator.validate(task, SequentialPlan([step_of(step) for step in plan]))
        return bool(result.status == ValidationResultStatus.VALID)

    return lambda plans: [is_valid(plan) for plan in plans]


PEERS: dict[str, tuple[Callable[[Path, Path], Callable[[Sequence[Plan]], list[bool]]], int]] = {
    "pyperplan": (pyperplan, 20_000),
    "pymimir": (pymimir, 2_000),
    "unified_planning": (unified_planning, 100),
}
"""By module: what makes its validator, and how many plans it gets."""


def spoiled(flat: np.ndarray, seed: int) -> np.ndarray:
    """A copy in which some steps are exchanged for others."""
    generator = np.random.default_rng(seed)
    places = generator.integers(len(flat), size=len(flat) // 48)
    operators = flat.copy()
    operators[places] = operators[generator.permutation(places)]
    return operators


def measured(work: Callable[[], Any], repeat: int, clock: Callable[[], float] = time.process_time) -> tuple[Any, float]:
    """What it gives and the seconds, of processor time unless by another clock, of its fastest run."""
    seconds = []
    for _ in range(repeat):
        start = clock()
        result = work()
        seconds.append(clock() - start)
    return result, min(seconds)


def main() -> int:
    """Validates the same plans with every system."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--plans", type=int, default=500_000, help="plans for this project (default 500,000)")
    parser.add_argument("--max-steps", type=int, default=13)
    parser.add_argument("--repeat", type=int, default=3)
    args = parser.parse_args()
    domain = Domain.parse(DOMAIN.read_bytes())
    task = Task(domain, Problem.parse(PROBLEM, domain))
    drawn = task.plan_set(args.max_steps).sample(args.plans, seed=0)
    operators, offsets = spoiled(drawn.operators, 0), drawn.offsets
    names = [task.operator_name(number) for number in range(task.num_operators)]
    plans = [
        [names[number] for number in operators[first:last]]
        for first, last in zip(offsets[:-1].tolist(), offsets[1:].tolist(), strict=True)
    ]
    texts = ["\n".join(plan) for plan in plans]
    rows: dict[str, float] = {}

    def report(system: str, count: int, seconds: float) -> None:
        rows[system] = count / seconds
        ratio = rows["strips-lm, text"] / rows[system]
        print(json.dumps({"system": system, "plans": count, "seconds": seconds, "text_over_it": ratio}), flush=True)
        line = f"{system:<22}{count:>10,} plans {seconds:9.3f} s {count / seconds:14,.0f} plans/s {ratio:9.1f} x"
        print(line, file=sys.stderr)

    codes, seconds = measured(lambda: task.outcomes(texts), args.repeat)
    report("strips-lm, text", len(texts), seconds)
    (by_id, _), seconds = measured(lambda: task.validate_ids(operators, offsets), args.repeat)
    report("strips-lm, ids", len(texts), seconds)
    verdicts, seconds = measured(lambda: task.validate_many(texts), args.repeat)
    report("strips-lm, verdicts", len(texts), seconds)
    expected = [verdict.is_valid for verdict in verdicts]
    assert expected == (codes == 0).tolist() == (by_id == 0).tolist()
    print(f"{sum(expected):,} of {len(expected):,} are valid", file=sys.stderr)
    with tempfile.TemporaryDirectory() as folder:
        problem = Path(folder) / "problem.pddl"
        problem.write_text(PROBLEM)
        for module, (make, count) in PEERS.items():
            if importlib.util.find_spec(module) is None:
                print(f"skipped: pip install {module.replace('_', '-')}", file=sys.stderr)
                continue
            validate = make(DOMAIN, problem)
            found, seconds = measured(lambda: validate(plans[:count]), 1)  # noqa: B023  (called at once)
            assert found == expected[:count], f"{module} disagrees"
            report(module, count, seconds)
    return 0


if __name__ == "__main__":
    sys.exit(main())
