"""A tiny data set in the format of `gen-data`, made here: three blocks, shortest plans by breadth-first search.

It exists so that the learning tests need neither the oracle nor its data. Texts follow docs/record-format.md.
"""

from __future__ import annotations

import itertools
import random
from typing import TYPE_CHECKING

import pyarrow as pa
import pyarrow.parquet as pq

if TYPE_CHECKING:
    from pathlib import Path

NAMES = ("red", "green", "blue", "black", "white", "gold", "grey", "pink")
Atom = tuple[str, ...]
State = frozenset[Atom]


def successors(state: State, blocks: tuple[str, ...]) -> list[tuple[Atom, State]]:
    """Every move of a clear block onto the table or another clear block."""
    below = {atom[1]: atom[2] for atom in state}
    clear = [block for block in blocks if block not in below.values()]
    moves = []
    for block, target in itertools.product(clear, (*clear, "table")):
        if target not in (block, below[block]):
            after = state - {("on", block, below[block])} | {("on", block, target)}
            moves.append((("move", block, target), after))
    return moves


def shortest_plan(start: State, goal: State, blocks: tuple[str, ...]) -> list[tuple[Atom, State]]:
    """Breadth-first search."""
    frontier: list[tuple[State, list[tuple[Atom, State]]]] = [(start, [])]
    seen = {start}
    for state, plan in frontier:
        if state == goal:
            return plan
        for action, after in successors(state, blocks):
            if after not in seen:
                seen.add(after)
                frontier.append((after, [*plan, (action, after)]))
    raise AssertionError("every tower can be reached")


def show(atoms: State) -> str:
    return ", ".join(f"{atom[0]}({', '.join(atom[1:])})" for atom in sorted(atoms))


def completion(plan: list[tuple[Atom, State]]) -> str:
    steps = [f"<ACTION> {action[0]}({', '.join(action[1:])}) <STATE> {show(state)} " for action, state in plan]
    return "".join(steps) + "<|endoftext|>"


def random_state(rng: random.Random, blocks: tuple[str, ...]) -> State:
    state: State = frozenset()
    order = list(blocks)
    rng.shuffle(order)
    for block in order:
        held = {atom[2] for atom in state}
        free = ["table", *(atom[1] for atom in state if atom[1] not in held)]
        state |= {("on", block, rng.choice(free))}
    return state


def record(rng: random.Random, index: int) -> dict[str, object]:
    blocks = tuple(rng.sample(NAMES, rng.choice((2, 3))))
    start, goal = random_state(rng, blocks), random_state(rng, blocks)
    plan = shortest_plan(start, goal, blocks)
    wrong = [plan[-1], *plan[:-1]] if len(plan) > 1 else [*plan, successors(goal, blocks)[0]]
    return {
        "index": index,
        "prompt": f"<|startoftext|> <GOAL> {show(goal)} <INIT> {show(start)}",
        "completion": completion(plan),
        "negative": completion(wrong),
        "plan": "\n".join(f"({' '.join(action)})" for action, _ in plan),
        "words": ["move"],
        "plan_count": "1",
        "steps": len(plan),
    }


def write(folder: Path, train: int = 400, validation: int = 40, seed: int = 0) -> Path:
    """Writes DIR/data/{train,validation}-*.parquet; the training split in two files."""
    rng = random.Random(seed)
    (folder / "data").mkdir(parents=True)
    rows = [record(rng, index) for index in range(train + validation)]
    cuts = {"train-00000-of-00002": (0, train // 2), "train-00001-of-00002": (train // 2, train)}
    cuts["validation-00000-of-00001"] = (train, train + validation)
    for name, (first, last) in cuts.items():
        pq.write_table(pa.Table.from_pylist(rows[first:last]), folder / "data" / f"{name}.parquet")
    return folder
