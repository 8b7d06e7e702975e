"""Checks the oracle against pymimir, pyperplan (relevance analysis off) and unified-planning on this project's files.

    uv run --with pymimir --with pyperplan --with unified-planning python benches/peers/cross_check.py

The files are those of ``tests/data/valid`` and some problems of every built-in domain. On each, every peer that reads
it walks breadth-first in step with the oracle, up to ``--states`` states, and at each state both must allow the same
operators, agree on the goal, and take each operator to states that are equal for the one exactly when they are for the
other; a walk that was not cut short so has the same number of states. Then plans from the plan set, and the same plans
with a step left out, doubled or exchanged, must be valid for both or for neither. Prints a line a file and peer; exit 1
on any difference. A peer that is not installed or does not support a file is named and skipped.
"""

from __future__ import annotations

import argparse
import importlib.util
import logging
import re
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import pyarrow.parquet as pq

from strips_lm import Domain, Problem, Task
from strips_lm.cli import main as strips_lm

if TYPE_CHECKING:
    from collections.abc import Callable, Hashable, Iterator

TOP = Path(__file__).resolve().parents[2]


REFUSED = re.compile(r"\(not \([^()]*\)\)|\(:requirements[^()]*\)")
"""What some peer does not read in a problem: negative goals and requirements, left out of made problems."""


class System(Protocol):
    """A peer's view of one task; its states are whatever it likes."""

    def init(self) -> Any:
        """The initial state."""

    def identity(self, state: Any) -> Hashable:
        """Equal for equal states."""

    def is_goal(self, state: Any) -> bool:
        """Whether the goal holds."""

    def successors(self, state: Any) -> dict[str, Any]:
        """Where each applicable operator leads, by its name such as ``(pick cup)``."""


class Mimir:
    """pymimir."""

    def __init__(self, domain: Path, problem: Path) -> None:
        import pymimir

        self.problem = pymimir.Problem(pymimir.Domain(domain), problem)
        self.goal = self.problem.get_goal_condition()
        self.arity = {name: len(types) for name, types in Domain.parse(domain.read_bytes()).actions}

    def init(self) -> Any:
        return self.problem.get_initial_state()

    def identity(self, state: Any) -> Hashable:
        return frozenset(map(str, state.get_atoms(ignore_static=True, ignore_fluent=False, ignore_derived=True)))

    def is_goal(self, state: Any) -> bool:
        return bool(self.goal.holds(state))

    def successors(self, state: Any) -> dict[str, Any]:
        def name(action: Any) -> str:  # it makes parameters of existential variables, after the action's own
            schema = action.get_action().get_name()
            objects = [item.get_name() for item in action.get_objects()[: self.arity[schema]]]
            return f"({' '.join([schema, *objects])})"

        return {name(action): action.apply(state) for action in state.generate_applicable_actions()}


class Pyperplan:
    """pyperplan, every operator kept."""

    def __init__(self, domain: Path, problem: Path) -> None:
        from pyperplan.grounding import ground
        from pyperplan.pddl.parser import Parser

        logging.disable()
        parser = Parser(str(domain), str(problem))
        read = parser.parse_problem(parser.parse_domain())
        self.task = ground(read, remove_statics_from_initial_state=False, remove_irrelevant_operators=False)

    def init(self) -> Any:
        return self.task.initial_state

    def identity(self, state: Any) -> Hashable:
        return state

    def is_goal(self, state: Any) -> bool:
        return bool(self.task.goal_reached(state))

    def successors(self, state: Any) -> dict[str, Any]:
        return {operator.name: following for operator, following in self.task.get_successor_states(state)}


class UnifiedPlanning:
    """unified-planning's simulator."""

    def __init__(self, domain: Path, problem: Path) -> None:
        import unified_planning.shortcuts as up
        from unified_planning.io import PDDLReader

        up.get_environment().credits_stream = None
        self.problem = PDDLReader().parse_problem(str(domain), str(problem))
        self.simulator = up.SequentialSimulator(self.problem)
        self.fluents = list(self.problem.initial_values)

    def init(self) -> Any:
        return self.simulator.get_initial_state()

    def identity(self, state: Any) -> Hashable:
        return tuple(state.get_value(fluent) for fluent in self.fluents if "total-cost" not in str(fluent))

    def is_goal(self, state: Any) -> bool:
        return bool(self.simulator.is_goal(state))

    def successors(self, state: Any) -> dict[str, Any]:
        def name(action: Any, parameters: Any) -> str:
            return f"({' '.join([action.name, *map(str, parameters)])})"

        allowed = list(self.simulator.get_applicable_actions(state))
        return {name(*step): self.simulator.apply(state, *step) for step in allowed}


PEERS: dict[str, tuple[str, Callable[[Path, Path], System], int]] = {
    "pymimir": ("pymimir", Mimir, 1),
    "pyperplan": ("pyperplan", Pyperplan, 1),
    "unified-planning": ("unified_planning", UnifiedPlanning, 10),
}
"""By name on PyPI: the module, the reader, and how many times fewer states it gets because it is slow."""


@dataclass(frozen=True)
class File:
    """A task on disk."""

    name: str
    domain: Path
    problem: Path

    def task(self) -> Task:
        domain = Domain.parse(self.domain.read_bytes())
        return Task(domain, Problem.parse(self.problem.read_bytes(), domain))


def corpus(folder: Path, problems: int) -> Iterator[File]:
    """The project's own files: those of the tests, and random problems of every built-in domain."""
    for path in sorted((TOP / "tests/data/valid").iterdir()):
        yield File(path.name, path / "domain.pddl", path / "problem.pddl")
    for path in sorted((TOP / "python/strips_lm/domains").iterdir()):
        if path.is_dir():
            yield from made(path.name, folder / path.name, problems)


def made(name: str, folder: Path, problems: int) -> Iterator[File]:
    few = ["--pairs", "60", "--set", "data.suite_records=10", "--set", "data.random_problems=100"]
    if strips_lm(["gen-data", "--out", str(folder), "--domain", name, *few]) != 0:
        raise SystemExit(f"gen-data failed on {name}")
    texts = pq.read_table(folder / "problems.parquet").column("problem").to_pylist()
    for number in range(0, len(texts), max(1, len(texts) // problems)):
        problem = folder / f"problem-{number}.pddl"
        problem.write_text(REFUSED.sub("", texts[number]))
        yield File(f"{name}-{number}", folder / "domain.pddl", problem)


def walk(task: Task, peer: System, most: int) -> tuple[int, bool]:
    """Walks both in step; how many states were compared, and whether these are all.

    Raises:
        AssertionError: they differ.
    """
    start = task.initial_state()
    ours, theirs = {start.tobytes(): peer.identity(peer.init())}, {peer.identity(peer.init())}
    queue = [(start, peer.init())]
    for state, other in queue:
        assert bool(task.is_goal(state)[0]) == peer.is_goal(other), f"the goal in {task.atoms(state)[0]}"
        operators, _ = task.applicable(state)
        names = [task.operator_name(int(operator)) for operator in operators]
        following = {name.lower(): value for name, value in peer.successors(other).items()}
        extra = sorted(set(names) ^ set(following))
        assert not extra, f"only one applies {extra[:3]} in {task.atoms(state)[0]}"
        next_states = task.successor(state.repeat(len(operators), axis=0), operators)
        for name, row in zip(names, next_states, strict=True):
            identity = peer.identity(following[name])
            if row.tobytes() not in ours:
                assert identity not in theirs, f"{name} leads to an old state in {task.atoms(state)[0]}"
                ours[row.tobytes()] = identity
                theirs.add(identity)
                if len(queue) < most:
                    queue.append((row[None], following[name]))
            assert ours[row.tobytes()] == identity, f"{name} leads elsewhere in {task.atoms(state)[0]}"
    return len(queue), len(queue) == len(ours)


def is_plan(peer: System, steps: tuple[str, ...]) -> bool:
    """Whether the peer can apply all the steps and is at the goal then."""
    state = peer.init()
    for step in steps:
        following = {name.lower(): value for name, value in peer.successors(state).items()}
        if step not in following:
            return False
        state = following[step]
    return peer.is_goal(state)


def plans(task: Task, count: int) -> list[tuple[str, ...]]:
    """Plans of any kind, and the same with a step left out, doubled or exchanged."""
    shortest = task.shortest_plan(12, max_states=200_000)
    if shortest is None:
        return [()]
    drawn = task.plan_set(len(shortest) + 1, "any", max_states=1_000_000).sample(count, seed=0)
    spoiled = [()]
    for plan in drawn:
        middle = len(plan) // 2
        spoiled += [plan[:middle] + plan[middle + 1 :], plan[:middle] + plan[middle - 1 :], plan[::-1]]
    return list(dict.fromkeys([*drawn, *spoiled]))


def compare(file: File, peer: System, states: int, count: int) -> str:
    """What was compared.

    Raises:
        AssertionError: they differ.
    """
    task = file.task()
    walked, all_of_them = walk(task, peer, states)
    tried = plans(task, count)
    verdicts = [verdict.is_valid for verdict in task.validate_many(["\n".join(plan) for plan in tried])]
    for plan, verdict in zip(tried, verdicts, strict=True):
        assert is_plan(peer, plan) == verdict, f"only one calls {plan} valid"
    return f"{walked} states{'' if all_of_them else ' (cut short)'}, {sum(verdicts)} of {len(tried)} plans valid"


def main() -> int:
    """Compares everything; 1 where something differs."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--states", type=int, default=300, help="most states of a walk (default 300)")
    parser.add_argument("--problems", type=int, default=3, help="problems of each built-in domain (default 3)")
    parser.add_argument("--plans", type=int, default=10, help="plans drawn on each (default 10)")
    args = parser.parse_args()
    installed = [name for name, (module, _, _) in PEERS.items() if importlib.util.find_spec(module)]
    for name in PEERS.keys() - set(installed):
        print(f"not installed, not compared: {name}", file=sys.stderr)
    differences = 0
    with tempfile.TemporaryDirectory() as folder:
        for file in corpus(Path(folder), args.problems):
            for name in installed:
                _, read, slower = PEERS[name]
                try:
                    peer = read(file.domain, file.problem)
                except (Exception, SystemExit) as error:
                    print(f"{file.name:<22}{name:<18}cannot read it: {type(error).__name__}: {str(error)[:80]!r}")
                    continue
                try:
                    found = compare(file, peer, args.states // slower, max(1, args.plans // slower))
                except AssertionError as error:
                    differences += 1
                    found = f"DIFFERS: {error}"
                print(f"{file.name:<22}{name:<18}{found}", flush=True)
    print(f"{differences} differences")
    return 1 if differences else 0


if __name__ == "__main__":
    sys.exit(main())
