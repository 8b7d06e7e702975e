"""Times `gen-data`: 71,128 pairs of the default domain, files and manifest included.

The measure is the plain-Python twin: the same kind of records (a template problem, names and words drawn, breadth-first
search done once a problem, states replayed, a negative redrawn until a replay proves it wrong), written the obvious way
with sets of tuples and without files. Its rate, times the cores that `gen-data` may use, is what ours is divided by.

    python benches/gen_data.py [--pairs N] [--jobs N] [--twin N]
"""

from __future__ import annotations

import argparse
import os
import random
import resource
import tempfile
import time
from pathlib import Path

from strips_lm.config import RunConfig
from strips_lm.shards import write_data_set
from strips_lm.sources import read_sources

NAMES = [f"thing_{number}" for number in range(60)]
WORDS = {"pick": ["pick", "lift", "grab"], "place": ["place", "put", "set"], "open": ["open", "uncover"]}


def ours(pairs: int, jobs: int) -> tuple[float, int]:
    """Seconds and bytes of one data set without suites' records beyond the default."""
    config = RunConfig.load(None, [f"data.pairs={pairs}"])
    with tempfile.TemporaryDirectory() as folder:
        start = time.perf_counter()
        write_data_set(Path(folder) / "set", config, read_sources("manipulation"), jobs=jobs)
        seconds = time.perf_counter() - start
        return seconds, sum(path.stat().st_size for path in Path(folder).rglob("*") if path.is_file())


class Twin:
    """`brew` with distractors: move a vessel from shelf to table, open it, put a thing on it."""

    def __init__(self) -> None:
        self.plans: dict[int, list[list[tuple[str, ...]]]] = {}

    def record(self, draw: random.Random) -> tuple[str, str, str]:
        """A prompt, a right completion and a wrong one."""
        things = 1 + draw.randrange(3)
        objects = ["v", *(f"a{number}" for number in range(things))]
        init = {
            ("in_reach", "table"),
            *(("in_reach", name) for name in objects),
            *(("on", n, "shelf") for n in objects),
        }
        goal = {("on", "a0", "v"), ("on", "v", "table"), ("opened", "v")}
        if things not in self.plans:
            self.plans[things] = search(frozenset(init), goal, objects)
        plan = draw.choice(self.plans[things])
        while True:
            wrong = draw.sample(plan, len(plan))
            if replay(init, wrong, objects) is None or not goal <= replay(init, wrong, objects)[-1]:
                break
        names = dict(zip([*objects, "shelf"], draw.sample(NAMES, len(objects) + 1), strict=True))
        words = {action: draw.choice(choices) for action, choices in WORDS.items()}
        states = replay(init, plan, objects)
        prompt = f"<|startoftext|> <GOAL> {atoms(states[-1], names)} <INIT> {atoms(init, names)}"
        shuffled = draw.sample(states, len(states))
        return prompt, completion(plan, states, names, words), completion(wrong, shuffled, names, words)


def steps(state: frozenset, objects: list[str]) -> list[tuple[tuple[str, ...], frozenset]]:
    """Every applicable step and the state after it."""
    held = [atom[1] for atom in state if atom[0] == "inhand"]
    found = []
    if held:
        for support in ["table", *objects]:
            if (
                support != held[0]
                and (support != "v" or ("opened", "v") in state)
                and not (held[0] == "v" and support != "table")
            ):
                after = (state - {("inhand", held[0])}) | {("on", held[0], support)}
                found.append((("place", held[0], support), frozenset(after)))
        return found
    for name in objects:
        if not any(atom[0] == "on" and atom[2] == name for atom in state):
            after = frozenset(atom for atom in state if atom[:2] != ("on", name)) | {("inhand", name)}
            found.append((("pick", name), after))
    if ("opened", "v") not in state:
        found.append((("open", "v"), state | {("opened", "v")}))
    return found


def search(init: frozenset, goal: set, objects: list[str]) -> list[list[tuple[str, ...]]]:
    """Every shortest plan."""
    layer = {init: [[]]}
    while not any(goal <= state for state in layer):
        following: dict[frozenset, list[list[tuple[str, ...]]]] = {}
        for state, plans in layer.items():
            for step, after in steps(state, objects):
                following.setdefault(after, []).extend([*plan, step] for plan in plans)
        layer = following
    return [plan for state, plans in layer.items() if goal <= state for plan in plans]


def replay(init: set, plan: list[tuple[str, ...]], objects: list[str]) -> list[frozenset] | None:
    """The states after each step, or none where one is not applicable."""
    state, states = frozenset(init), []
    for step in plan:
        after = dict(steps(state, objects)).get(step)
        if after is None:
            return None
        state = after
        states.append(state)
    return states


def atoms(state: frozenset | set, names: dict[str, str]) -> str:
    """The state as text."""
    called = (f"{name}({', '.join(names.get(arg, arg) for arg in args)})" for name, *args in sorted(state))
    return ", ".join(called)


def completion(plan: list, states: list, names: dict[str, str], words: dict[str, str]) -> str:
    """The steps as text."""
    parts = (
        f"<ACTION> {words[name]}({', '.join(names.get(arg, arg) for arg in args)}) <STATE> {atoms(state, names)} "
        for (name, *args), state in zip(plan, states, strict=True)
    )
    return "".join(parts) + "<|endoftext|>"


def main() -> None:
    """Prints both rates."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pairs", type=int, default=71_128)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--twin", type=int, default=5_000, help="records of the plain-Python generator")
    args = parser.parse_args()
    seconds, size = ours(args.pairs, args.jobs)
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    rate = args.pairs / seconds
    print(f"gen-data: {args.pairs:,} pairs in {seconds:.2f} s ({rate:,.0f}/s), {size / 1e6:.1f} MB, {memory:.0f} MiB")
    twin, draw, start = Twin(), random.Random(0), time.perf_counter()
    for _ in range(args.twin):
        twin.record(draw)
    plain = args.twin / (time.perf_counter() - start)
    print(
        f"plain Python: {plain:,.0f}/s on one core (load {os.getloadavg()[0]:.1f}); ours {rate / plain:.1f} times that"
    )


if __name__ == "__main__":
    main()
