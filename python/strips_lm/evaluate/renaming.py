"""Whether a model's plan depends on what things are called: the same problems under other names, greedily.

Names are drawn from those of the suite without regard to what they mean, and only the names change: the order of
objects and atoms, and the words for actions, stay. Price: one completion a renaming.
"""

from __future__ import annotations

import random
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

from strips_lm import _native

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping, Sequence

    from strips_lm.evaluate.suites import Item
    from strips_lm.generate import Planner

Operators = tuple[tuple[str, ...], ...]

_ARGUMENTS = re.compile(r"\(([^()]*)\)")


@dataclass(frozen=True, slots=True)
class Names:
    """Where other names come from."""

    pool: Sequence[str]
    constants: Collection[str]
    """Names of the domain, which stay."""
    times: int
    """Sets of names for each problem."""
    seed: int


def invariance(planner: Planner, items: Sequence[Item], names: Names) -> dict[str, int]:
    """How many renamings of the items' prompts give the same plan up to names.

    Returns `problems`, `renamed`, `same` and `always`: the problems whose plan stays the same under all.
    """
    prompts: list[str] = []
    back: list[dict[str, str]] = []
    times = names.times
    for number, item in enumerate(items):
        own = [name for name in item.names if name not in names.constants]
        for turn in range(times + 1):
            new = draw(names.pool, len(own), f"{names.seed} {number} {turn}") if turn else own
            prompts.append(rename(item.prompt, dict(zip(own, new, strict=True))))
            back.append(dict(zip(new, own, strict=True)))
    made = planner.complete(prompts, "greedy").completions
    plans = [operators(c.text, given) for c, given in zip(made, back, strict=True)]
    groups = [plans[start : start + times + 1] for start in range(0, len(plans), times + 1)]
    same = [sum(plan == first for plan in rest) for first, *rest in groups]
    return {
        "problems": len(items),
        "renamed": times * len(items),
        "same": sum(same),
        "always": sum(count == times for count in same),
    }


def draw(pool: Sequence[str], count: int, seed: str) -> list[str]:
    """`count` different names, made up where the pool has too few."""
    rng = random.Random(seed)  # noqa: S311  (nothing secret)
    return rng.sample([*pool, *(f"thing_{i}" for i in range(len(pool), count))], count)


def rename(prompt: str, names: Mapping[str, str]) -> str:
    """The prompt with other names: in the list of objects, and as arguments of atoms."""
    head, mark, rest = prompt.partition("<OBJECTS> ")
    if mark:
        listed = re.split(" <VOCAB> | <GOAL> ", rest, maxsplit=1)[0]
        rest = rest[len(listed) :]
        entries = (entry.split(" ", 1) for entry in listed.split(", "))
        listed = ", ".join(" ".join([names.get(name, name), *kind]) for name, *kind in entries)
        return f"{_in_atoms(head, names)}{mark}{listed}{_in_atoms(rest, names)}"
    return _in_atoms(prompt, names)


def _in_atoms(text: str, names: Mapping[str, str]) -> str:
    def put(found: re.Match[str]) -> str:
        return f"({', '.join(names.get(name, name) for name in found[1].split(', '))})"

    return _ARGUMENTS.sub(put, text)


def operators(text: str, names: Mapping[str, str]) -> Operators:
    """The operators of a completion, its names given back."""
    steps = _native.parse_completions([text])[0].steps
    return tuple((action, *(names.get(arg, arg) for arg in args)) for (action, args), _ in steps)
