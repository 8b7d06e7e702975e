"""Ctrl-C while the oracle works: answered within 200 ms, and nothing is left behind.

Each case is a process of its own that is busy with something long. It is sent SIGINT in the middle of it and says when
the exception arrived. The clock is the system's, so the time between is what a user waits. A busy machine can let a
process wait longer for its turn, so the best of some attempts counts; what is slow for a reason is slow every time.
"""

from __future__ import annotations

import contextlib
import signal
import subprocess
import sys
import time
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from pathlib import Path

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="Windows sends no SIGINT to a child")

ATTEMPTS = 4
PROLOGUE = """
import sys, time
import numpy as np
from strips_lm import Domain, Problem, Task

def switches(count, goal=2):
    domain = Domain.parse(
        "(define (domain bits) (:requirements :adl) (:predicates (on ?x)) (:action flip :parameters (?x)"
        " :effect (and (when (on ?x) (not (on ?x))) (when (not (on ?x)) (on ?x)))))"
    )
    names = [f"s{i}" for i in range(count)]
    goals = " ".join(f"(on {name})" for name in names[:goal])
    problem = f"(define (problem p) (:domain bits) (:init) (:objects {' '.join(names)}) (:goal (and {goals})))"
    return Task(domain, Problem.parse(problem, domain))
"""
EPILOGUE = """
try:
    print("ready", flush=True)
    work()
    print("done", flush=True)
except KeyboardInterrupt:
    print(time.monotonic(), flush=True)
"""
WORK = {
    "searching": "task = switches(40)\ndef work(): task.plan_set(60)",
    "the shortest plan": "task = switches(40, 40)\ndef work(): task.shortest_plan(60)",
    "distances": "task = switches(40, 40)\ndef work(): task.distance_to_goal(task.initial_state())",
    "counting": "task = switches(11)\ndef work(): task.plan_set(3000, 'any')",
    "simple plans": "task = switches(12, 6)\ndef work(): task.plan_set(14, 'simple')",
    "drawing": "plans = switches(12).plan_set(12, 'any')\ndef work(): plans.sample(5_000_000, 0)",
    "listing": "plans = switches(12).plan_set(12, 'any')\ndef work():\n    for plan in plans: pass",
    "writing": "plans = switches(12).plan_set(12, 'any')\ndef work():\n    while True: plans.text(0, 1 << 16)",
    "validating": (
        "task = switches(40)\ntexts = ['(flip s0)\\n' * 50_000 + '(flip s1)\\n(flip s0)'] * 20_000\n"
        "def work(): task.validate_many(texts)"
    ),
    "grounding": (
        "names = ' '.join(f'o{i}' for i in range(60))\n"
        "near = ' '.join(f'(p o{i} o{j})' for i in range(60) for j in range(60))\n"
        "domain = Domain.parse('(define (domain d) (:requirements :adl) (:predicates (p ?x ?y) (done)) (:action a'\n"
        "    ' :parameters (?a ?b ?c ?d ?e ?f) :precondition (and (p ?a ?b) (p ?b ?c) (p ?c ?d) (p ?d ?e) (p ?e ?f)'\n"
        "    ' (not (p ?f ?a))) :effect (done)))')\n"
        "problem = Problem.parse(f'(define (problem e) (:domain d) (:objects {names}) (:init {near}) (:goal (done)))',"
        " domain)\ndef work(): Task(domain, problem)"
    ),
}


def seconds_to_answer(work: str) -> float:
    """From the signal to the exception."""
    with subprocess.Popen(
        [sys.executable, "-c", PROLOGUE + work + EPILOGUE], stdout=subprocess.PIPE, text=True
    ) as child:
        assert child.stdout is not None
        assert child.stdout.readline() == "ready\n"
        time.sleep(0.3)
        sent = time.monotonic()
        child.send_signal(signal.SIGINT)
        answer = child.stdout.readline().strip()
        assert answer != "done", "the work was too short"
        assert child.wait(timeout=30) == 0
    return float(answer) - sent


@pytest.mark.parametrize("what", WORK)
def test_ctrl_c_is_answered_within_200_ms(what):
    delays = []
    for _ in range(ATTEMPTS):
        delays.append(seconds_to_answer(WORK[what]))
        if delays[-1] < 0.2:
            return
    pytest.fail(f"{what}: answered after {', '.join(f'{delay:.3f}' for delay in delays)} s")


def test_an_interrupted_command_exits_with_130_and_leaves_no_file(cups, tmp_path: Path):
    out = tmp_path / "plans.txt"
    command = [sys.executable, "-m", "strips_lm", "plans", *cups.args(), "--semantics", "any", "--max-steps", "40"]
    before = set(tmp_path.iterdir())
    with subprocess.Popen([*command, "--output", str(out)], stderr=subprocess.PIPE, text=True) as child:
        deadline = time.monotonic() + 60
        while not any(map(size, tmp_path.glob("plans.txt.part*"))):
            assert time.monotonic() < deadline, "nothing was written"
            time.sleep(0.02)
        child.send_signal(signal.SIGINT)
        assert child.wait(timeout=30) == 130
        assert child.stderr is not None
        assert child.stderr.read() == "interrupted\n"
    assert set(tmp_path.iterdir()) == before


def size(path: Path) -> int:
    with contextlib.suppress(FileNotFoundError):
        return path.stat().st_size
    return 0
