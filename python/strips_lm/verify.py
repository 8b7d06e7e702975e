"""Proving a data set again, from its files alone.

Every file has the size and hash that the manifest says; every positive is a right completion for its own problem; every
negative is wrong for the recorded reason at the recorded step; no record is there twice; each suite shares none of what
it holds out with training. Works a row group at a time; a split's names and hashes of texts are all that is kept.
"""

from __future__ import annotations

import hashlib
import json
import re
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import pyarrow.parquet as pq

from strips_lm._native import Domain, Problem, judge
from strips_lm.config.names import ConfigError
from strips_lm.shards import ROW_GROUP, digest

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from strips_lm._native import Judgement

    Row = dict[str, Any]

COLUMNS = [
    "index",
    "prompt",
    "completion",
    "negative",
    "plan",
    "negative_verdict",
    "negative_step",
    "problem_id",
    "names",
    "words",
    "steps",
    "optimal_steps",
]

NAME = re.compile(r"[^\s(),<>|]+")
"""A word of a completion, markers left out."""

HELD_OUT = {
    "unseen-objects": "names",
    "unseen-made-up-names": "names",
    "unseen-actions": "words",
    "unseen-shapes": "problems",
    "unseen-template": "problems",
    "more-objects": "problems",
    "longer": "problems",
}
"""What each suite must not share with training."""


@dataclass(slots=True)
class Found:
    """What a split was found to hold."""

    names: set[str] = field(default_factory=set)
    words: set[str] = field(default_factory=set)
    problems: set[str] = field(default_factory=set)
    texts: set[bytes] = field(default_factory=set)


@dataclass(slots=True)
class Verification:
    """What was checked, and what was found wrong."""

    records: int = 0
    faults: list[str] = field(default_factory=list)


def verify(folder: Path, tick: Callable[[int], None] = lambda _: None, most_faults: int = 20) -> Verification:
    """Checks the data set; stops after `most_faults` faults.

    Raises:
        ConfigError: it is not a finished data set of Parquet files.
    """
    if not (folder / "manifest.json").is_file():
        raise ConfigError(f"{folder}: no finished data set here\nhint: strips-lm gen-data --out {folder}")
    manifest = json.loads((folder / "manifest.json").read_text(encoding="utf-8"))
    result = Verification(faults=_wrong_files(folder, manifest["files"]))
    checker = _Checker(folder)
    found = {}
    for split in manifest["splits"]:
        found[split] = Found()
        for row_group in _row_groups(folder, split):
            result.faults += checker.check(split, row_group, found[split])
            result.records += len(row_group)
            tick(result.records)
            if len(result.faults) >= most_faults:
                return result
    result.faults += _shared(found)
    return result


def _wrong_files(folder: Path, files: dict[str, dict[str, Any]]) -> list[str]:
    faults = []
    for name, expected in files.items():
        path = folder / name
        if not path.is_file():
            faults.append(f"{name}: missing")
        elif digest(path) != expected:
            faults.append(f"{name}: not the file that the manifest describes")
    return faults


def _row_groups(folder: Path, split: str) -> Iterator[list[Row]]:
    paths = sorted((folder / "data").glob(f"{split.replace('-', '_')}-*.parquet"))
    if not paths:
        raise ConfigError(f"{folder}: no Parquet files of the split {split}")
    for path in paths:
        for batch in pq.ParquetFile(path).iter_batches(ROW_GROUP, columns=COLUMNS):
            yield batch.to_pylist()


class _Checker:
    """Checks records against the oracle."""

    def __init__(self, folder: Path) -> None:
        text = (folder / "domain.pddl").read_text(encoding="utf-8")
        self._domain = Domain.parse(text, str(folder / "domain.pddl"))
        self._actions = [name for name, _ in self._domain.actions]
        self._constants = len(self._domain.constants)
        self._names: dict[int, list[str]] = {}
        table = pq.read_table(folder / "problems.parquet")
        self._problems = table["problem"].to_pylist()
        self._hashes = table["canonical_hash"].to_pylist()

    def check(self, split: str, rows: list[Row], found: Found) -> list[str]:
        """The faults of the records; what they hold is added to `found`."""
        problems = [self._problems[row["problem_id"]] for row in rows]
        words = [dict(zip(row["words"], self._actions, strict=True)) for row in rows]
        positives = judge(self._domain, problems, [self._slots(row, "completion") for row in rows], words)
        negatives = judge(self._domain, problems, [self._slots(row, "negative") for row in rows], words)
        faults = []
        for row, positive, negative in zip(rows, positives, negatives, strict=True):
            complaint = _complaint(row, positive, negative) or self._note(row, found)
            if complaint:
                faults.append(f"{split} {row['index']}: {complaint}")
        return faults

    def _slots(self, row: Row, column: str) -> str:
        """The completion with the problem's own names: one problem is grounded once for all its records."""
        slots = dict(zip(row["names"], self._objects(row["problem_id"]), strict=True))
        return NAME.sub(lambda match: slots.get(match.group(), match.group()), row[column])

    def _objects(self, problem_id: int) -> list[str]:
        """The names that the problem itself gives its objects."""
        if problem_id not in self._names:
            problem = Problem.parse(self._problems[problem_id], self._domain)
            self._names[problem_id] = [name for name, _ in problem.objects]
        return self._names[problem_id]

    def _note(self, row: Row, found: Found) -> str:
        text = hashlib.sha256(f"{row['prompt']}\0{row['completion']}".encode()).digest()[:16]
        if text in found.texts:
            return "the same record is there twice"
        found.texts.add(text)
        found.names.update(row["names"][self._constants :])
        found.words.update(row["words"])
        found.problems.add(self._hashes[row["problem_id"]])
        return ""


def _complaint(row: Row, positive: Judgement, negative: Judgement) -> str:
    """What is wrong with the record, or nothing."""
    if not (positive.verdict.is_valid and positive.finished):
        return f"the positive is not valid: {positive.verdict.reason}"
    if positive.states_right != positive.states_total:
        return f"the positive's state after step {positive.first_wrong_state} is wrong"
    if row["steps"] != positive.steps or row["optimal_steps"] > positive.steps:
        return "the recorded numbers of steps are wrong"
    verdict, step = negative.verdict.outcome, negative.verdict.step
    if verdict == "valid" and negative.first_wrong_state is not None:
        verdict, step = "wrong_state", negative.first_wrong_state
    if (verdict, step) != (row["negative_verdict"], row["negative_step"]):
        return f"the negative is {verdict} at step {step}, not {row['negative_verdict']} at {row['negative_step']}"
    return ""


def _shared(found: dict[str, Found]) -> list[str]:
    """What a suite shares with training although it holds it out, and records that are in two splits."""
    trained, faults = found["train"], []
    for split, held_out in HELD_OUT.items():
        if split in found:
            shared = getattr(trained, held_out) & getattr(found[split], held_out)
            faults += [f"{split}: shares {held_out[:-1]} {item} with train" for item in sorted(shared)[:3]]
    for split, records in found.items():
        if split != "train" and trained.texts & records.texts:
            faults.append(f"{split}: {len(trained.texts & records.texts)} records are in train as well")
    return faults
