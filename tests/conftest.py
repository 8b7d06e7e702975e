"""What the Python tests share: a small task of our own, and the command line as a user has it."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

from strips_lm.cli import main

TOP = Path(__file__).parents[1]

# A job in the background ignores Ctrl-C, and so would the programs that the tests start and interrupt.
signal.signal(signal.SIGINT, signal.default_int_handler)

DOMAIN = """\
(define (domain cups)
  (:requirements :strips :typing :negative-preconditions)
  (:types cup place - object)
  (:predicates (at ?c - cup ?p - place) (held ?c - cup) (busy))
  (:action pick
    :parameters (?c - cup ?p - place)
    :precondition (and (at ?c ?p) (not (busy)))
    :effect (and (held ?c) (busy) (not (at ?c ?p))))
  (:action put
    :parameters (?c - cup ?p - place)
    :precondition (held ?c)
    :effect (and (at ?c ?p) (not (held ?c)) (not (busy)))))
"""

PROBLEM = """\
(define (problem move-one)
  (:domain cups)
  (:objects red blue - cup table shelf - place)
  (:init (at red table) (at blue table))
  (:goal (at red shelf)))
"""


@dataclass(frozen=True)
class Files:
    """A domain and a problem on disk."""

    domain: Path
    problem: Path

    def args(self) -> list[str]:
        return [str(self.domain), str(self.problem)]


@pytest.fixture
def cups(tmp_path: Path) -> Files:
    """Two cups on a table, one of which belongs on the shelf."""
    files = Files(tmp_path / "domain.pddl", tmp_path / "problem.pddl")
    files.domain.write_text(DOMAIN)
    files.problem.write_text(PROBLEM)
    return files


@dataclass(frozen=True)
class Result:
    """What a command left: its exit code and what it wrote."""

    code: int
    out: str
    err: str


@pytest.fixture
def cli(capsys: pytest.CaptureFixture[str]):
    """Runs a command line in this process."""

    def run(*argv: object) -> Result:
        code = main([str(arg) for arg in argv])
        out, err = capsys.readouterr()
        return Result(code, out, err)

    return run


@pytest.fixture
def shell():
    """Runs a command line in a process of its own."""

    def run(*argv: object, **options: object) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, "-m", "strips_lm", *map(str, argv)]
        environment = os.environ | {"PYTHONPATH": str(TOP / "python")}
        return subprocess.run(command, capture_output=True, text=True, timeout=120, env=environment, **options)

    return run
