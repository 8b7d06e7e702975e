"""Fuzzing without a nightly compiler: mutates the corpus and gives it to the oracle through Python.

    uv run python fuzz/mutate.py [--minutes 10] [--seed 0] [domain|problem|plan|whole]...

The targets are those of `fuzz_targets/`, without coverage to guide them: any text as a domain, as a problem and as a
plan, and the whole path of the three. What is read must print back to an equal text; what is refused must be refused by
the oracle's own errors; nothing may panic, abort or hang. An input that does is left in `fuzz/found-*`; exit 1.
"""

from __future__ import annotations

import argparse
import multiprocessing
import random
import re
import sys
import time
from pathlib import Path

from strips_lm import Domain, LimitError, PddlError, Problem, Task

TOP = Path(__file__).resolve().parents[1]
TARGETS = ("domain", "problem", "plan", "whole")
PLANS = ["(pick a)\n(drop a)", "0.000: (pick a) [1.0]\r\n; c\n(DROP a)", "", "()", "(a", "(a b))"]
PIECES = re.compile(r"\s+|[()]|[^\s()]+")
ODD = [
    "(",
    ")",
    "()",
    "-",
    "?x",
    "- object",
    "(either a b)",
    ":",
    ";",
    "\0",
    "\ufeff",
    "\u00e9",
    "not",
    "and",
    "when",
    "=",
    "9" * 30,
]
SLOW = 5.0
"""Seconds after which an input counts as one that hangs: the limits given end the work long before."""


def mutated(draw: random.Random, texts: list[str]) -> str:
    """One of the texts with some of its pieces changed, and sometimes a bit of another."""
    pieces = PIECES.findall(draw.choice(texts))
    for _ in range(draw.choice([0, 1, 1, 2, 4, 16])):
        first = draw.randrange(len(pieces) + 1)
        last = min(len(pieces), first + draw.choice([0, 1, 1, 3, 20]))
        other = PIECES.findall(draw.choice(texts)) or [""]
        start = draw.randrange(len(other))
        new = draw.choice(
            [[], pieces[first:last] * 2, [draw.choice(ODD)], other[start : start + 9], pieces[first:last][::-1]]
        )
        pieces[first:last] = new
    return "".join(pieces)


def read_domain(text: str) -> Domain:
    """Parses, and checks that printing it changes nothing."""
    domain = Domain.parse(text)
    printed = domain.to_pddl()
    assert Domain.parse(printed).to_pddl() == printed
    return domain


def read_problem(text: str, domain: Domain) -> Problem:
    """As `read_domain`."""
    problem = Problem.parse(text, domain)
    printed = problem.to_pddl()
    assert Problem.parse(printed, domain).to_pddl() == printed
    return problem


def whole(domain: str, problem: str, plan: str) -> None:
    """Everything the oracle does to a task; plans of its set must be valid."""
    read = read_domain(domain)
    task = Task(read, read_problem(problem, read), max_operators=2000, max_bytes=1 << 26, time_limit=1)
    assert task.validate_many([plan]) == [task.validate(plan)]
    plans = task.plan_set(3, max_states=2000, max_bytes=1 << 26, time_limit=1)
    some = list(plans[:20])
    assert all(verdict.is_valid for verdict in task.validate_many(["\n".join(plan) for plan in some]))
    assert [plans.rank(plan) for plan in some] == list(range(len(some)))


def attempt(target: str, draw: random.Random, corpus: dict[str, list[str]]) -> tuple[str, ...]:
    """The texts for a target: mutated where it reads them."""
    number = draw.randrange(len(corpus["domain"]))
    domain, problem = corpus["domain"][number], corpus["problem"][number]
    if target in ("domain", "whole") and draw.random() < (1 if target == "domain" else 0.5):
        domain = mutated(draw, [domain] * 3 + corpus["domain"])
    if target in ("problem", "whole"):
        problem = mutated(draw, [problem] * 3 + corpus["problem"])
    return domain, problem, mutated(draw, PLANS)


def work(target: str, seed: int, minutes: float, shared: object) -> None:
    """Tries inputs until the time is up; the one at hand lies in a file, for the case that the process dies."""
    draw = random.Random(seed)
    folders = [path for path in (TOP / "tests/data/valid").iterdir() if path.is_dir()]
    read = lambda name: [(folder / f"{name}.pddl").read_text("utf-8-sig") for folder in folders]  # noqa: E731
    corpus = {"domain": read("domain"), "problem": read("problem")}
    at_hand = TOP / f"fuzz/found-{target}"
    end, tried = time.monotonic() + minutes * 60, 0
    while time.monotonic() < end:
        texts = attempt(target, draw, corpus)
        at_hand.write_bytes("\0".join(texts).encode())
        start = time.thread_time()
        try:
            if target == "domain":
                read_domain(texts[0])
            elif target == "problem":
                read_problem(texts[1], Domain.parse(texts[0]))
            else:
                whole(*texts)
        except (PddlError, LimitError):
            pass
        assert time.thread_time() - start < SLOW, "too slow"
        tried += 1
        shared.value = tried  # type: ignore[attr-defined]
    at_hand.unlink()


def main() -> int:
    """Runs a process a target, one after the other; 1 where one failed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("targets", nargs="*", choices=(*TARGETS, []), default=[], metavar="TARGET")
    parser.add_argument("--minutes", type=float, default=10, help="for each target (default 10)")
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args()
    failed = []
    for target in args.targets or TARGETS:
        tried = multiprocessing.Value("q", 0)
        process = multiprocessing.Process(target=work, args=(target, args.seed, args.minutes, tried))
        process.start()
        process.join()
        print(f"{target}: {tried.value:,} inputs, exit {process.exitcode}", flush=True)
        if process.exitcode != 0:
            failed.append(target)
            print(f"the input is in fuzz/found-{target}: domain, problem and plan, with a zero byte between")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
