"""Search against K*, Fast Downward's blind search and pyperplan, on the same generated files, in one run, as ratios.

Needs a Rust toolchain, and whichever of the peers are to be compared from PyPI: ``pip install kstar-planner
up-symk up-fast-downward unified-planning pyperplan``. Prints one JSON object a comparison to stdout and a table to
stderr. Times are processor time, so that a busy machine does not blur them; the fastest of ``--repeat`` runs counts.
Four comparisons:

- all plans of gripper with four balls in 15 steps, start to end: our whole process against K*'s, which counts the same
  plans (its horizon is a multiple of the optimum; no operator of the domain changes nothing, as K* would drop it);
- a plan: the same against SymK, which stops after some thousands, as it writes a file for each;
- the first plan: our search against the time that Fast Downward reports for its blind search alone;
- states a second, one thread each: ours, Fast Downward's expansions, pyperplan's breadth-first search.
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import re
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable

TOP = Path(__file__).resolve().parents[2]
OPTIMUM, HORIZON = 11, 15
SYMK_PLANS = 5000
KSTAR = (
    "kstar(blind(), q={quality}, k=100000000, find_unordered_plans=false, "
    "dump_plan_files=false, json_file_to_dump={file})"
)


def run(command: list[str], folder: Path) -> tuple[str, float]:
    """The command's standard output and its processor time in seconds."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(command, check=False, capture_output=True, text=True, cwd=folder)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return done.stdout, (after.ru_utime + after.ru_stime) - (before.ru_utime + before.ru_stime)


def fastest(repeat: int, measure: Callable[[], dict[str, float]], key: str) -> dict[str, float]:
    """The run with the least ``key``."""
    return min((measure() for _ in range(repeat)), key=lambda result: result[key])


def ours(binary: Path, *arguments: object) -> dict[str, float]:
    """This project's figures, with the whole process's time."""
    output, process = run([str(binary), *map(str, arguments)], TOP)
    return {**json.loads(output), "process": process}


def kstar(folder: Path) -> dict[str, float]:
    """K*: every plan up to the horizon, written to a file as it does."""
    import kstar_planner

    build = Path(kstar_planner.__file__).parent / "builds" / "release" / "bin"
    plans = folder / "plans.json"
    search = KSTAR.format(quality=HORIZON / OPTIMUM + 0.001, file=plans)
    files = [str(folder / "domain.pddl"), str(folder / "problem.pddl")]
    command = [
        sys.executable,
        "-B",
        "-m",
        "kstar_planner.driver.main",
        "--build",
        str(build),
        *files,
        "--search",
        search,
    ]
    output, process = run(command, folder)
    found = re.search(r"Found plans: (\d+)", output)
    return {"plans": int(found.group(1)) if found else 0, "process": process}


def symk(folder: Path) -> dict[str, float]:
    """SymK: the first plans in order of length, a file each."""
    import up_symk

    program = Path(up_symk.__file__).parent / "symk" / "fast-downward.py"
    files = [str(folder / "domain.pddl"), str(folder / "problem.pddl")]
    search = f"symk_bd(plan_selection=top_k(num_plans={SYMK_PLANS}))"
    with tempfile.TemporaryDirectory() as plans:
        output, process = run([sys.executable, str(program), *files, "--search", search], Path(plans))
        found = len(list(Path(plans).rglob("sas_plan*")))
    if not found:
        raise SystemExit(f"SymK found no plans:\n{output[-2000:]}")
    return {"plans": found, "process": process}


def fast_downward(folder: Path) -> dict[str, float]:
    """Fast Downward's blind search: its own time, and states expanded."""
    import up_fast_downward

    program = Path(up_fast_downward.__file__).parent / "downward" / "fast-downward.py"
    files = [str(folder / "domain.pddl"), str(folder / "problem.pddl")]
    output, process = run([sys.executable, str(program), *files, "--search", "astar(blind())"], folder)
    seconds = re.search(r"Search time: ([0-9.e-]+)s", output)
    expanded = re.search(r"Expanded (\d+) state", output)
    if not seconds or not expanded:
        raise SystemExit(f"Fast Downward gave no figures:\n{output[-2000:]}")
    return {"seconds": float(seconds.group(1)), "states": int(expanded.group(1)), "process": process}


def pyperplan(folder: Path) -> dict[str, float]:
    """pyperplan's breadth-first search: its time, and states expanded."""
    import logging

    from pyperplan.grounding import ground
    from pyperplan.pddl.parser import Parser
    from pyperplan.search.breadth_first_search import breadth_first_search

    parser = Parser(str(folder / "domain.pddl"), str(folder / "problem.pddl"))
    task = ground(parser.parse_problem(parser.parse_domain()))
    expanded: list[int] = []
    successors = task.get_successor_states
    task.get_successor_states = lambda state: expanded.append(1) or successors(state)
    logging.disable()
    start = time.process_time()
    breadth_first_search(task)
    return {"seconds": time.process_time() - start, "states": len(expanded)}


def all_plans(binary: Path, folder: Path, repeat: int) -> None:
    """Every plan up to the horizon, start to end."""
    without_no_ops(folder)
    files = (folder / "domain.pddl", folder / "problem.pddl")
    mine = fastest(repeat, lambda: ours(binary, "plans", *files, HORIZON), "process")
    peer = fastest(repeat, lambda: kstar(folder), "process")
    row = {"what": "all plans", "task": folder.name, "plans": mine["plans"], "peer": "K*", "peer_plans": peer["plans"]}
    report({**row, "seconds": mine["process"], "peer_seconds": peer["process"]})


def a_plan(binary: Path, folder: Path, repeat: int) -> None:
    """Seconds a million plans, of all up to the horizon, against SymK's of its first ones."""
    files = (folder / "domain.pddl", folder / "problem.pddl")
    mine = fastest(repeat, lambda: ours(binary, "plans", *files, HORIZON), "process")
    peer = fastest(1, lambda: symk(folder), "process")
    row = {"what": "a million plans", "task": folder.name, "plans": mine["plans"], "peer": "SymK"}
    seconds = {key: 1e6 * side["process"] / side["plans"] for key, side in (("seconds", mine), ("peer_seconds", peer))}
    report({**row, "peer_plans": peer["plans"], **seconds})


def without_no_ops(folder: Path) -> None:
    """Rewrites the gripper domain so that the robot never drives to where it is."""
    domain, problem = folder / "domain.pddl", folder / "problem.pddl"
    text = domain.read_text().replace(
        ":precondition (robot-in ?from)", ":precondition (and (robot-in ?from) (next ?from ?to))"
    )
    domain.write_text(text.replace("(:predicates", "(:predicates (next ?a ?b - room)"))
    problem.write_text(problem.read_text().replace("(:init", "(:init (next r0 r1) (next r1 r0)"))


def first_plan(binary: Path, folder: Path, repeat: int) -> None:
    """The first plan, search alone, and states a second."""
    files = (folder / "domain.pddl", folder / "problem.pddl")
    mine = fastest(repeat, lambda: ours(binary, "first", *files), "first_plan")
    peer = fastest(repeat, lambda: fast_downward(folder), "seconds")
    row = {"task": folder.name, "peer": "Fast Downward, blind"}
    report({"what": "first plan", **row, "seconds": mine["first_plan"], "peer_seconds": peer["seconds"]})
    states_a_second(mine, peer, row)


def breadth_first(binary: Path, folder: Path, repeat: int) -> None:
    """States a second against pyperplan."""
    files = (folder / "domain.pddl", folder / "problem.pddl")
    mine = fastest(repeat, lambda: ours(binary, "first", *files), "explore")
    peer = fastest(repeat, lambda: pyperplan(folder), "seconds")
    states_a_second(mine, peer, {"task": folder.name, "peer": "pyperplan"})


def states_a_second(mine: dict[str, float], peer: dict[str, float], row: dict[str, Any]) -> None:
    """Microseconds a state, so that less is better as in the other rows."""
    seconds = {
        "seconds": mine["explore"] / mine["states"] * 1e6,
        "peer_seconds": peer["seconds"] / peer["states"] * 1e6,
    }
    report({"what": "a million states", **row, "states": mine["states"], "peer_states": peer["states"], **seconds})


def report(row: dict[str, Any]) -> None:
    """One line of the table."""
    row["ratio"] = row["peer_seconds"] / row["seconds"]
    print(json.dumps(row), flush=True)
    counts = " ".join(f"{key}={row[key]:,}" for key in ("plans", "peer_plans", "states", "peer_states") if key in row)
    print(
        f"{row['what']:<17}{row['task']:<15}{row['seconds']:9.4f} s   {row['peer']:<21}{row['peer_seconds']:9.4f} s "
        f"{row['ratio']:8.1f} x  {counts}",
        file=sys.stderr,
    )


def main() -> int:
    """Runs the comparisons whose peer is installed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeat", type=int, default=3)
    repeat = parser.parse_args().repeat
    subprocess.run(["cargo", "build", "--release", "-q", "-p", "strips-bench", "--bin", "search"], cwd=TOP, check=True)
    binary = TOP / "target" / "release" / "search"
    comparisons: list[tuple[str, str, Callable[[Path, Path, int], None], list[str]]] = [
        ("up_fast_downward", "up-fast-downward", first_plan, ["gripper-8", "gripper-12", "blocksworld-8"]),
        ("pyperplan", "pyperplan", breadth_first, ["blocksworld-6"]),
        ("up_symk", "up-symk", a_plan, ["gripper-4"]),
        ("kstar_planner", "kstar-planner", all_plans, ["gripper-4"]),
    ]
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run([str(binary), "write", folder], check=True, capture_output=True)
        for module, package, compare, tasks in comparisons:
            if importlib.util.find_spec(module) is None:
                print(f"skipped: pip install {package}", file=sys.stderr)
                continue
            for task in tasks:
                compare(binary, Path(folder) / task, repeat)
    return 0


if __name__ == "__main__":
    sys.exit(main())
