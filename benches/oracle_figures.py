"""Every line of the oracle's speed targets as a figure beside its target, in one run of a few minutes.

    uv run --with kstar-planner --with up-fast-downward --with unified-planning --with pyperplan \\
        --with fast-downward-translate python benches/oracle_figures.py

Times are on the clock, the best of some runs, so run it on a quiet machine; the targets are for two cores. Lines that
need a peer from PyPI are left out where it is not installed. Exit 1 where a figure misses its target.
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

TOP = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(TOP / "benches/peers"))

import ground as ground_peers  # noqa: E402  (the peers' scripts lie beside each other)
import search as search_peers  # noqa: E402
import validate as validate_peers  # noqa: E402

from strips_lm import Domain, Problem, Task  # noqa: E402

if TYPE_CHECKING:
    from collections.abc import Callable

REPEAT = 3
missed: list[str] = []


def show(what: str, figure: float, target: float, unit: str, *, less: bool = False) -> None:
    """One line: figure, target, and whether it is reached."""
    reached = figure <= target if less else figure >= target
    if not reached:
        missed.append(what)
    sign = "≤" if less else "≥"
    print(f"{what:<66}{figure:>12,.2f} {sign} {target:<10,.2f}{unit:<14}{'' if reached else 'MISSED'}", flush=True)


def best(work: Callable[[], Any], repeat: int = REPEAT) -> tuple[Any, float]:
    """What it gives and the seconds of its fastest run."""
    return validate_peers.measured(work, repeat, time.perf_counter)


def task_of(folder: Path) -> Task:
    """The task whose two files lie in a folder."""
    domain = Domain.parse((folder / "domain.pddl").read_bytes())
    return Task(domain, Problem.parse((folder / "problem.pddl").read_bytes(), domain))


def enumeration(folder: Path, binary: Path) -> None:
    """Plans a second into numpy, as text, and counting."""
    for name, horizon in (("gripper-8", 23), ("evening", 8)):
        plans = task_of(folder / name).plan_set(horizon)
        flat, seconds = best(lambda: plans[:10_000_000])  # noqa: B023  (called at once)
        show(f"ids into numpy, {name}, T = {horizon}", len(flat) / seconds / 1e6, 20, "M plans/s")
        text, seconds = best(lambda: plans.text(0, 1_000_000))  # noqa: B023
        show(f"as text, {name} ({len(text) >> 20} MiB)", 1 / seconds, 2, "M plans/s")
    evening = task_of(folder / "evening")
    count, seconds = best(lambda: evening.plan_set(8, "any").count())
    assert count == 858_375_000
    show("exact count of 858,375,000 plans", seconds, 0.1, "s", less=True)
    if importlib.util.find_spec("kstar_planner"):
        search_peers.without_no_ops(folder / "gripper-4")
        files = (folder / "gripper-4/domain.pddl", folder / "gripper-4/problem.pddl")
        mine, seconds = best(lambda: search_peers.ours(binary, "plans", *files, search_peers.HORIZON))
        peer, peer_seconds = best(lambda: search_peers.kstar(folder / "gripper-4"), 1)
        what = f"all {mine['plans']:,} plans of gripper-4, start to end, over K* ({peer['plans']:,})"
        show(what, peer_seconds / seconds, 100, "x")


def first_plan(folder: Path) -> None:
    """Against Fast Downward's blind search alone."""
    if not importlib.util.find_spec("up_fast_downward"):
        return
    for name in ("gripper-8", "blocksworld-8", "gripper-12"):
        task = task_of(folder / name)
        _, seconds = best(task.shortest_plan)
        peer = search_peers.fast_downward(folder / name)
        show(
            f"first plan, {name}, over FD's blind search ({peer['states']:,} states)", peer["seconds"] / seconds, 1, "x"
        )


def breadth_first(folder: Path, binary: Path) -> None:
    """States a second on one core and two, and their memory."""
    for name in ("blocksworld-8", "gripper-8", "gripper-12"):
        files = [str(folder / name / file) for file in ("domain.pddl", "problem.pddl")]
        one, two = _fastest(binary, files)
        rate = two["states"] / two["seconds"]
        show(f"breadth first, {name}, {two['states']:,} states, two threads", rate / 1e6, 2, "M states/s")
        if two["states"] > 100_000:  # fewer are done in milliseconds, before a second thread is at work
            show(f"breadth first, {name}, two threads over one", one["seconds"] / two["seconds"], 1.7, "x")
        show(f"memory beside the packed state, {name}", two["bytes_beside"], 32, "bytes", less=True)
        if importlib.util.find_spec("up_fast_downward") and name != "gripper-12":
            peer = search_peers.fast_downward(folder / name)
            show(f"breadth first, {name}, over FD's blind", rate * peer["seconds"] / peer["states"], 2, "x")


def _fastest(binary: Path, files: list[str]) -> list[dict[str, Any]]:
    """The fastest exploration on one thread and on two, tried in turns."""
    runs: list[list[dict[str, Any]]] = [[], []]
    for _ in range(REPEAT):
        for threads, found in enumerate(runs, 1):
            found.append(json.loads(search_peers.run([str(binary), "explore", *files, str(threads)], TOP)[0]))
    return [min(found, key=lambda run: run["seconds"]) for found in runs]


def validation() -> None:
    """Plans a second from Python, and over the pyperplan loop."""
    domain = Domain.parse(validate_peers.DOMAIN.read_bytes())
    task = Task(domain, Problem.parse(validate_peers.PROBLEM, domain))
    drawn = task.plan_set(13).sample(1_000_000, seed=0)
    texts = drawn.text().rstrip("\n").split("\n\n")
    _, seconds = best(lambda: task.outcomes(texts))
    rate = len(texts) / seconds
    show("validation from text", rate / 1e6, 2, "M plans/s")
    _, by_id = best(lambda: task.validate_ids(drawn.operators, drawn.offsets))
    show("validation from ids", len(texts) / by_id / 1e6, 20, "M plans/s")
    if importlib.util.find_spec("pyperplan"):
        with tempfile.TemporaryDirectory() as folder:
            problem = Path(folder) / "problem.pddl"
            problem.write_text(validate_peers.PROBLEM)
            loop = validate_peers.pyperplan(validate_peers.DOMAIN, problem)
            some = [text.splitlines() for text in texts[:20_000]]
            verdicts, seconds = best(lambda: loop(some), 1)
            assert all(verdicts)
            show("validation from text, over the pyperplan loop", rate * seconds / len(some), 20, "x")


def grounding(folder: Path) -> None:
    """Against the translator on the largest task of each kind."""
    if not importlib.util.find_spec("fast_downward"):
        return
    binary = TOP / "target/release/ground"
    names = search_peers.run([str(binary), "write", str(folder)], TOP)[0].split()
    for name in sorted({name.split("-")[0]: name for name in names}.values()):
        row = ground_peers.compare(binary, folder / name, 1)
        if row["operators"] > 10_000:  # the target is about large tasks
            show(f"grounding {name}, {row['operators']:,} operators, over the translator", row["ratio"], 10, "x")


def streaming(folder: Path) -> None:
    """How much the process grows while it goes over millions of plans."""
    plans = task_of(folder / "evening").plan_set(8)
    chunk = ""
    for start in (0, 1 << 16):
        chunk = plans.text(start, start + (1 << 16))  # the one before is still there, as in the loop below
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    for start in range(0, 3_000_000, 1 << 16):
        chunk = plans.text(start, start + (1 << 16))
    assert chunk
    for number, _ in enumerate(plans):
        if number == 1_000_000:
            break
    grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
    show("memory that streaming 4 M plans adds to the peak", grown / 1024, 8, "MiB", less=True)


def main() -> int:
    """All lines; 1 where one misses its target."""
    argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter).parse_args()
    command = ["cargo", "build", "--release", "-q", "-p", "strips-bench", "--bin", "search", "--bin", "ground"]
    subprocess.run(command, cwd=TOP, check=True)
    binary = TOP / "target/release/search"
    print(f"{os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        subprocess.run([str(binary), "write", name], check=True, capture_output=True)
        streaming(folder)
        first_plan(folder)
        breadth_first(folder, binary)
        validation()
        grounding(folder)
        enumeration(folder, binary)
    print(f"{len(missed)} missed: {'; '.join(missed)}" if missed else "every target is reached")
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
