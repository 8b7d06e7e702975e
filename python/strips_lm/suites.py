"""What each suite of a data set holds out, and whether it is so. Knows no files."""

from __future__ import annotations

from dataclasses import dataclass, field

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


@dataclass(slots=True)
class Found:
    """What a split was found to hold."""

    names: set[str] = field(default_factory=set)
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
    texts: set[int] = field(default_factory=set)
    """Hashes of whole records."""
    predicate_words: set[str] = field(default_factory=set)
    """Words for predicates, where the data set has such."""


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
        common_texts = len(trained.texts & records.texts)
        if split != "train" and common_texts:
            faults.append(f"{split}: {common_texts} records are in train as well")
    return faults
