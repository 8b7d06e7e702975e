"""What each suite of a data set holds out, and whether it is so. Knows no files."""

from __future__ import annotations

from array import array
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterable

HELD_OUT = {
    "unseen-objects": "names",
    "unseen-made-up-names": "names",
    "unseen-actions": "words",
    "unseen-predicates": "predicate_words",
    "unseen-shapes": "problems",
    "unseen-template": "templates",
    "more-objects": "problems",
    "longer": "problems",
    "large": "problems",
}
"""What each suite must not share with training."""


class Hashes:
    """Hashes of 64 bits, in the order in which they came; eight bytes each, a tenth of what a set of numbers takes."""

    def __init__(self, hashes: Iterable[int] = ()) -> None:
        self._all = array("q", hashes)

    def add(self, value: int) -> None:
        """Adds one, as `hash` gives it."""
        self._all.append(value)

    def repeated(self) -> list[int]:
        """The positions of those that had come before, ascending."""
        found = np.array(self._all, np.int64)
        order = np.argsort(found, kind="stable")
        again = found[order[1:]] == found[order[:-1]]
        return sorted(order[1:][again].tolist())

    def shared(self, other: Hashes) -> int:
        """How many different ones are in both."""
        return int(np.isin(np.unique(np.array(self._all, np.int64)), np.array(other._all, np.int64)).sum())


@dataclass(slots=True)
class Found:
    """What a split was found to hold."""

    names: set[str] = field(default_factory=set)
    """Names of objects; where `asked` is given, those of them that it holds."""
    words: set[str] = field(default_factory=set)
    """Words for actions."""
    problems: set[str] = field(default_factory=set)
    """Canonical hashes."""
    templates: set[str] = field(default_factory=set)
    sizes: set[int] = field(default_factory=set)
    """Numbers of objects."""
    lengths: set[int] = field(default_factory=set)
    """Steps of shortest plans, as far as they are known."""
    steps: set[int] = field(default_factory=set)
    """Steps of plans."""
    texts: Hashes = field(default_factory=Hashes)
    """Hashes of whole records."""
    predicate_words: set[str] = field(default_factory=set)
    """Words for predicates, where the data set has such."""
    asked: set[str] | None = None
    """The only names that matter: made-up words have no end."""

    def add_names(self, names: list[str]) -> None:
        """Adds the names of a record."""
        self.names.update(names if self.asked is None else self.asked.intersection(names))


def shared(found: dict[str, Found]) -> list[str]:
    """What a suite shares with training although it holds it out, and records that are in two splits."""
    trained, faults = found["train"], []
    for split, held_out in HELD_OUT.items():
        if split in found:
            common = getattr(trained, held_out) & getattr(found[split], held_out)
            faults += [
                f"{split}: shares {held_out[:-1].replace('_', ' ')} {item} with train" for item in sorted(common)[:3]
            ]
    if "unseen-template" in found and trained.problems & found["unseen-template"].problems:
        faults.append("unseen-template: shares problems with train")
    if "more-objects" in found and min(found["more-objects"].sizes) <= max(trained.sizes):
        faults.append(f"more-objects: {min(found['more-objects'].sizes)} objects, train has {max(trained.sizes)}")
    if "longer" in found and min(found["longer"].lengths) <= max(trained.steps):
        faults.append(f"longer: a plan of {min(found['longer'].lengths)} steps, train has {max(trained.steps)}")
    for split, records in found.items():
        common_texts = 0 if split == "train" else records.texts.shared(trained.texts)
        if common_texts:
            faults.append(f"{split}: {common_texts} records are in train as well")
    return faults
