"""Proving a data set again, from its files alone.

Three proofs, none of which leans on another:

- the manifest: every file has the size and hash that it says, and there are no others;
- the oracle (`Prover`, `suites`): every column of every record is held against the problem's PDDL, canonical hashes
  are computed anew, no record is there twice, each suite shares none of what it holds out with training;
- the making: `run.toml` and the domain's files give every cell again, for data sets made by this version.

Works a row group at a time; kept are the problems, what suites hold out, and eight bytes a record: a hash of its text.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from functools import partial
from itertools import islice
from typing import TYPE_CHECKING, Any

import pyarrow as pa
import pyarrow.parquet as pq

from strips_lm._native import DataError, Domain, PddlError, Prover, __version__
from strips_lm.config import RunConfig
from strips_lm.config.names import ConfigError
from strips_lm.folders import TOKENS, data_sets, is_mixture
from strips_lm.mixture import files
from strips_lm.shards import RECORDS, ROW_GROUP, table
from strips_lm.sources import read_kept
from strips_lm.storage import file_digest, open_store
from strips_lm.suites import HELD_OUT, Found, shared

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from strips_lm._native import RecordStream

    Row = dict[str, Any]


@dataclass(slots=True)
class Verification:
    """What was checked, and what was found wrong."""

    records: int = 0
    faults: list[str] = field(default_factory=list)
    made_again: bool = True
    """Whether every cell was compared with what `run.toml` gives; not so for data sets of another version."""


def verify(folder: Path, tick: Callable[[int], None] = lambda _: None, most_faults: int = 20) -> Verification:
    """Checks the data set, or each of a mixture; stops after `most_faults` faults.

    Raises:
        ConfigError: it is not a finished data set.
    """
    if not is_mixture(folder):
        return _verify_one(folder, tick, most_faults)
    whole = Verification(faults=_wrong_parts(folder))
    for part in data_sets(folder):
        found = _verify_one(part, partial(_tick_on, tick, whole.records), most_faults)
        whole.faults += [f"{part.name}: {fault}" for fault in found.faults]
        whole.records += found.records
        whole.made_again &= found.made_again
        if len(whole.faults) >= most_faults:
            break
    return whole


def _tick_on(tick: Callable[[int], None], before: int, done: int) -> None:
    tick(before + done)


def _wrong_parts(folder: Path) -> list[str]:
    """What is wrong with a mixture's own files; one put together by hand need have none."""
    if not (folder / "manifest.json").is_file():
        return []
    expected = json.loads((folder / "manifest.json").read_text(encoding="utf-8"))["files"]
    found = files(open_store(folder), [part.name for part in data_sets(folder)])
    faults = [f"{name}: not in the manifest" for name in sorted(set(found) - set(expected))]
    return faults + [
        f"{name}: not the file that the manifest describes" for name in expected if found.get(name) != expected[name]
    ]


def _verify_one(folder: Path, tick: Callable[[int], None], most_faults: int) -> Verification:
    if not (folder / "manifest.json").is_file():
        raise ConfigError(f"{folder}: no finished data set here\nhint: strips-lm gen-data --out {folder}")
    manifest = json.loads((folder / "manifest.json").read_text(encoding="utf-8"))
    result = Verification(faults=_wrong_files(folder, manifest["files"]))
    try:
        stream = _stream(folder)
        checker = _Checker(folder)
    except (ConfigError, DataError, PddlError, pa.ArrowInvalid) as error:
        result.faults.append(str(error))
        return result
    result.made_again = stream is not None
    result.faults += checker.problem_faults(stream)
    if stream is not None and dict(stream.splits) != manifest["splits"]:
        result.faults.append("manifest.json: other splits than run.toml gives")
    found: dict[str, Found] = {}
    held_out: set[str] = set()
    # Suites first: of the names that training has, only those that a suite holds out need be kept.
    for split, records in sorted(manifest["splits"].items(), key=lambda item: item[0] not in HELD_OUT):
        found[split], start = Found(asked=None if HELD_OUT.get(split) == "names" else held_out), 0
        for row_group in _readable(_row_groups(folder, split), split, result.faults):
            result.faults += checker.check(split, start, row_group, found[split], stream)
            start += row_group.num_rows
            result.records += row_group.num_rows
            tick(result.records)
            if len(result.faults) >= most_faults:
                return result
        if start != records:
            result.faults.append(f"{split}: {start} records, not {records}")
        again = found[split].texts.repeated()[:most_faults]
        result.faults += [f"{split} {number}: the same record is there twice" for number in again]
        if HELD_OUT.get(split) == "names":
            held_out |= found[split].names
    result.faults += shared(found)
    return result


def _stream(folder: Path) -> RecordStream | None:
    """What makes the data set again, if this version made it."""
    kept = RunConfig.load(folder / "run.toml")
    text = (folder / "run.toml").read_text(encoding="utf-8")
    return read_kept(folder).stream(kept) if f'strips-lm = "{__version__}"' in text else None


def _wrong_files(folder: Path, files: dict[str, dict[str, Any]]) -> list[str]:
    there = {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}
    faults = [
        f"{name}: not in the manifest"
        for name in sorted(there - set(files) - {"manifest.json"})
        if not any(part.startswith(".") for part in name.split("/")) and not name.startswith(f"{TOKENS}/")
    ]
    for name, expected in files.items():
        if name not in there:
            faults.append(f"{name}: missing")
        elif file_digest(folder / name) != expected:
            faults.append(f"{name}: not the file that the manifest describes")
    return faults


def _row_groups(folder: Path, split: str) -> Iterator[pa.Table]:
    name = split.replace("-", "_")
    paths = [path for path in sorted((folder / "data").glob(f"{name}-*")) if path.suffix in (".parquet", ".jsonl")]
    if not paths:
        raise ConfigError(f"{folder}: no files of the split {split}")
    for path in paths:
        if path.suffix == ".jsonl":
            yield from _lines(path)
            continue
        for batch in pq.ParquetFile(path).iter_batches(ROW_GROUP):
            yield pa.Table.from_batches([batch])


def _lines(path: Path) -> Iterator[pa.Table]:
    """A file of JSON Lines, as many records at a time as a row group has.

    Raises:
        pa.ArrowInvalid: a line is no record.
    """
    with path.open(encoding="utf-8") as file:
        numbered = enumerate(file, 1)
        while rows := [_record(path.name, number, line) for number, line in islice(numbered, ROW_GROUP)]:
            try:
                yield pa.Table.from_pylist(rows, schema=RECORDS)
            except (TypeError, OverflowError) as error:
                raise pa.ArrowInvalid(f"{path.name}: {error}") from None


def _record(file: str, number: int, line: str) -> Row:
    try:
        row = json.loads(line)
    except ValueError as error:
        raise pa.ArrowInvalid(f"{file}:{number}: {error}") from None
    if not isinstance(row, dict) or list(row) != RECORDS.names:
        raise pa.ArrowInvalid(f"{file}:{number}: other fields than a record has")
    return row


def _readable(tables: Iterator[pa.Table], split: str, faults: list[str]) -> Iterator[pa.Table]:
    """The tables as far as they can be read; a file that is none of Parquet's is a fault."""
    try:
        yield from tables
    except pa.ArrowInvalid as error:
        faults.append(f"{split}: {str(error).splitlines()[0]}")


class _Checker:
    """Checks records against the oracle and against what `run.toml` gives."""

    def __init__(self, folder: Path) -> None:
        text = (folder / "domain.pddl").read_text(encoding="utf-8")
        domain = Domain.parse(text, str(folder / "domain.pddl"))
        self._domain = domain.name
        self._fixed = len(domain.constants) + len(domain.pending)
        self._actions = len(domain.actions)
        self._table = pq.read_table(folder / "problems.parquet")
        self._problems: list[Row] = self._table.to_pylist()
        self._prover = Prover(domain, [row["problem"] for row in self._problems])

    def problem_faults(self, stream: RecordStream | None) -> list[str]:
        """What is wrong with the problems: hashes and sizes computed anew, isomorphic ones, other than made."""
        faults, seen = [], set()
        hashes = self._prover.hashes([row["goal_style"] == "state" for row in self._problems])
        for number, (row, (code, objects)) in enumerate(zip(self._problems, hashes, strict=True)):
            if (row["problem_id"], row["domain"]) != (number, self._domain):
                faults.append(f"problem {number}: another `problem_id` or `domain` is recorded")
            if (row["canonical_hash"], row["num_objects"]) != (code, objects):
                faults.append(f"problem {number}: the canonical hash is {code}, of {objects} objects, not as recorded")
            if code in seen:
                faults.append(f"problem {number}: isomorphic to an earlier one")
            seen.add(code)
        if stream is not None:
            faults += _differing("problems", 0, self._table, table(stream.problems()))
        return faults

    def check(self, split: str, start: int, rows: pa.Table, found: Found, stream: RecordStream | None) -> list[str]:
        """The faults of the records from `start` on; what they hold is added to `found`."""
        listed: list[Row] = rows.to_pylist()
        faults = []
        for number, (row, fault) in enumerate(zip(listed, self._prover.check(listed), strict=True)):
            found.texts.add(hash((row["prompt"], row["completion"], row["negative"])))
            complaint = fault or self._about_problem(row, start + number)
            if complaint:
                faults.append(f"{split} {start + number}: {complaint}")
            else:
                self._note(row, found)
        if stream is not None:
            stop = min(start + len(listed), dict(stream.splits).get(split, 0))
            faults += _differing(split, start, rows, table(stream.batch(split, min(start, stop), stop)))
        return faults

    def _about_problem(self, row: Row, index: int) -> str:
        problem = self._problems[row["problem_id"]]
        if row["index"] != index:
            return f"its recorded index is {row['index']}"
        if row["template"] != problem["template"]:
            return "its template is not its problem's"
        if row["goal_style"] != problem["goal_style"]:
            return "its way of saying the goal is not its problem's"
        if row["optimal_steps"] != problem["shortest"] or row["steps"] < (row["optimal_steps"] or 1):
            return "the recorded numbers of steps do not fit its problem"
        return ""

    def _note(self, row: Row, found: Found) -> None:
        problem = self._problems[row["problem_id"]]
        found.add_names(row["names"][self._fixed :])
        found.words.update(row["words"][: self._actions])
        found.predicate_words.update(row["words"][self._actions :])
        found.problems.add(problem["canonical_hash"])
        found.templates.add(problem["template"])
        found.sizes.add(problem["num_objects"])
        if row["optimal_steps"] is not None:
            found.lengths.add(row["optimal_steps"])
        found.steps.add(row["steps"])


def _differing(where: str, start: int, rows: pa.Table, made: pa.Table) -> list[str]:
    """The first cell of each column that is not what was made."""
    if rows.column_names != made.column_names or rows.num_rows != made.num_rows:
        return [f"{where} {start}: other columns, or another number of rows, than run.toml gives"]
    faults = []
    for name in made.column_names:
        ours, theirs = rows[name].combine_chunks(), made[name].combine_chunks()
        if not ours.cast(theirs.type).equals(theirs):
            pairs = zip(ours.to_pylist(), theirs.to_pylist(), strict=True)
            row = next(number for number, (one, other) in enumerate(pairs) if one != other)
            faults.append(f"{where} {start + row}: `{name}` is not what run.toml gives")
    return faults
