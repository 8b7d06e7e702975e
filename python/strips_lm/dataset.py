"""A split of a data set as token arrays on disk: tokenized once, memory-mapped, reused.

The arrays lie in `DATA/tokens/<key>/<split>/`, where the key is a hash of the split's Parquet files and of the
tokenizer; a finished folder has an `index.json`, written last. Records are read a row group at a time, so that the
price is constant memory whatever the data's size. A pair shares its prompt. Records that the model's context cannot
hold are counted, reported and left out, never cut. A mixture's data sets are tokenized each by itself and read as one.
Batches are `strips_lm.batches`' concern.
"""

from __future__ import annotations

import hashlib
import itertools
import json
import math
import os
import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow.parquet as pq

from strips_lm._native import DataError, Domain
from strips_lm.folders import TOKENS, data_sets
from strips_lm.tokenizer import fingerprint

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence, Sized

    from numpy.typing import NDArray

    from strips_lm.goal_targets import GoalReader
    from strips_lm.spelling import Spelling
    from strips_lm.tokenizer import PlanTokenizer

COLUMNS = ("index", "prompt", "completion", "negative", "words", "plan_count")
"""The columns that training reads."""

PARTS = ("prompts", "positives", "negatives")
"""The token sequences of a record."""

ROWS = 4096
"""Records tokenized at a time."""


class DataSetError(DataError):
    """A data set that cannot be trained on."""


@dataclass(frozen=True, slots=True)
class Ragged:
    """Sequences of unequal length in one flat array."""

    tokens: NDArray[np.integer]
    offsets: NDArray[np.int64]

    def __getitem__(self, index: int) -> NDArray[np.integer]:
        return self.tokens[self.offsets[index] : self.offsets[index + 1]]

    def __len__(self) -> int:
        return len(self.offsets) - 1

    @property
    def lengths(self) -> NDArray[np.int64]:
        """The length of each sequence."""
        return np.diff(self.offsets)


@dataclass(frozen=True, slots=True)
class Chain:
    """The sequences of several, one behind the other, each where it lies."""

    parts: tuple[Ragged | Chain, ...]
    starts: NDArray[np.int64]
    """The number of each part's first sequence, and of all sequences."""

    @classmethod
    def of(cls, parts: Sequence[Ragged | Chain]) -> Chain:
        """Joins them in order."""
        return cls(tuple(parts), _starts(parts))

    def __getitem__(self, index: int) -> NDArray[np.integer]:
        part = int(np.searchsorted(self.starts, index, side="right")) - 1
        return self.parts[part][index - int(self.starts[part])]

    def __len__(self) -> int:
        return int(self.starts[-1])

    @property
    def lengths(self) -> NDArray[np.int64]:
        """The length of each sequence."""
        return np.concatenate([part.lengths for part in self.parts])


@dataclass(frozen=True, slots=True)
class StepPool:
    """Single steps, each after a prompt from the state before it, that a second head is to tell apart."""

    prompts: Ragged
    steps: Ragged
    right: NDArray[np.int64]
    """The numbers of those that hold."""
    wrong: NDArray[np.int64]

    def __bool__(self) -> bool:
        """Whether there are steps of both kinds."""
        return len(self.right) > 0 and len(self.wrong) > 0


@dataclass(frozen=True, slots=True)
class PlanDataset:
    """The pairs of one split; record numbers below are positions in these arrays."""

    prompts: Ragged | Chain
    positives: Ragged | Chain
    negatives: Ragged | Chain
    index: NDArray[np.int64]
    """Each record's index in its data set."""
    entropies: NDArray[np.float64]
    """Nats that no model can save on each record: the logarithm of the number of plans it was drawn from."""
    kept: NDArray[np.int64]
    """The records that fit the context; the others are left out."""
    pad: int
    """The padding token."""
    slots: tuple[tuple[int, int], ...]
    """(first, count) of each block of tokens that may be renumbered within it."""
    spelling: Spelling | None = None
    """How names are drawn for the slots, where the model is to read spelled ones."""
    named: PlanDataset | None = None
    """The same records with the data's own names, where a `spelling` does not draw all of them."""
    mixed: tuple[tuple[str, int], ...] = ()
    """Of a mixture, the name of each data set and the number of its first record."""
    own_steps: StepPool | None = None
    """What the second head is shown in place of the records' negatives."""
    goal_reader: GoalReader | None = None
    """What finds out how states stand to goals, where the layers are told."""

    def __len__(self) -> int:
        return len(self.kept)

    @property
    def left_out(self) -> int:
        """Records that are too long for the context."""
        return len(self.index) - len(self.kept)

    @property
    def lengths(self) -> NDArray[np.int64]:
        """Tokens of each record's prompt and positive."""
        return self.prompts.lengths + self.positives.lengths

    def parts(self, record: int) -> list[NDArray[np.integer]]:
        """A record's prompt, positive and negative."""
        return [self.prompts[record], self.positives[record], self.negatives[record]]

    def label(self, record: int) -> str:
        """The record's index in its data set, with that one's name where there are several."""
        names = [name for name, first in self.mixed if first <= record]
        return " ".join([*names[-1:], str(self.index[record])])


def open_data(data: str | Path, split: str, tokenizer: PlanTokenizer, context: int, room: int = 0) -> PlanDataset:
    """The split of a data set, or of all data sets of a mixture as one; else as `open_split`."""
    folders = data_sets(Path(data))
    parts = [open_split(folder, split, speaking(tokenizer, folder), context, room) for folder in folders]
    return parts[0] if len(parts) == 1 else mix(parts, [folder.name for folder in folders])


def speaking(tokenizer: PlanTokenizer, folder: Path) -> PlanTokenizer:
    """The tokenizer for the texts of a data set's domain."""
    path = folder / "domain.pddl"
    return tokenizer.of_domain(Domain.parse(path.read_bytes(), str(path))) if path.is_file() else tokenizer


def mix(parts: Sequence[PlanDataset], names: Sequence[str]) -> PlanDataset:
    """All records of several data sets, each set's spread evenly over the order of `kept`."""
    starts = _starts([part.index for part in parts])
    kept = np.concatenate([part.kept + start for part, start in zip(parts, starts, strict=False)])
    places = np.concatenate([(np.arange(len(part)) + 0.5) / len(part) for part in parts])
    return PlanDataset(
        prompts=Chain.of([part.prompts for part in parts]),
        positives=Chain.of([part.positives for part in parts]),
        negatives=Chain.of([part.negatives for part in parts]),
        index=np.concatenate([part.index for part in parts]),
        entropies=np.concatenate([part.entropies for part in parts]),
        kept=kept[np.argsort(places, kind="stable")],
        pad=parts[0].pad,
        slots=parts[0].slots,
        mixed=tuple(zip(names, starts.tolist(), strict=False)),
    )


def _starts(parts: Sequence[Sized]) -> NDArray[np.int64]:
    """The number of the first of each part's things, and of all things."""
    return np.concatenate(([0], np.cumsum([len(part) for part in parts], dtype=np.int64)))


def open_split(data: str | Path, split: str, tokenizer: PlanTokenizer, context: int, room: int = 0) -> PlanDataset:
    """The split of one data set, tokenized now unless that was done before.

    `context` is the most positions that a record may take and `room` what a position offset may add to it.

    Raises:
        DataSetError: the split is missing or empty, or none of its records fits.
    """
    files = split_files(data, split)
    folder = Path(data) / TOKENS / _key(files, tokenizer) / split
    if not (folder / "index.json").is_file():
        _tokenize(files, tokenizer, folder)
    prompts, positives, negatives = [
        Ragged(_map(folder / f"{part}.tokens.npy"), _map(folder / f"{part}.offsets.npy")) for part in PARTS
    ]
    longest = prompts.lengths + np.maximum(positives.lengths, negatives.lengths)
    kept = np.flatnonzero(longest + room <= context)
    if len(kept) == 0:
        raise DataSetError(f"{data}: no record of `{split}` fits {context} positions\nhint: raise `model.context`")
    index, entropies = np.load(folder / "records.npy"), np.load(folder / "entropies.npy")
    return PlanDataset(prompts, positives, negatives, index, entropies, kept, tokenizer.end_id, tokenizer.slots)


def entropy_floor(data: PlanDataset, records: int) -> float:
    """The lowest language-model loss (nats a scored token) that any model can have on the first `records` records.

    A plan is drawn uniformly from its problem's plans, and everything else in a completion follows from it.
    """
    picked = data.kept[:records]
    return float(data.entropies[picked].sum() / data.positives.lengths[picked].sum())


def split_files(data: str | Path, split: str) -> list[Path]:
    """The Parquet files of a split, in order.

    Raises:
        DataSetError: there are none.
    """
    files = sorted((Path(data) / "data").glob(f"{split.replace('-', '_')}-*.parquet"))
    files = files or sorted((Path(data) / "data").glob(f"{split}-*.parquet"))
    if not files:
        raise DataSetError(f"{data}: no data/{split}-*.parquet\nhint: make a data set with `strips-lm gen-data`")
    return files


def read_rows(files: Sequence[Path], columns: Sequence[str], rows: int = ROWS) -> Iterator[dict[str, list[Any]]]:
    """Columns of the files, `rows` records at a time."""
    for path in files:
        with pq.ParquetFile(path) as file:
            for batch in file.iter_batches(batch_size=rows, columns=list(columns)):
                yield batch.to_pydict()


def texts(data: str | Path, split: str = "train", limit: int = 20_000) -> Iterator[str]:
    """The first `limit` records' texts, for a tokenizer to learn from; of a mixture as many of each data set."""
    folders = data_sets(Path(data))
    for folder in folders:
        rows = read_rows(split_files(folder, split), ("prompt", "completion"))
        pairs = (pair for batch in rows for pair in zip(batch["prompt"], batch["completion"], strict=True))
        for prompt, completion in itertools.islice(pairs, -(-limit // len(folders))):
            yield f"{prompt} {completion}"


def _map(path: Path) -> NDArray[Any]:
    # As a plain array: each slice of a `memmap` costs ten times as much.
    return np.asarray(np.load(path, mmap_mode="r"))


def _key(files: Sequence[Path], tokenizer: PlanTokenizer) -> str:
    digest = hashlib.sha256(fingerprint(tokenizer).encode())
    for path in files:
        with path.open("rb") as file:
            digest.update(hashlib.file_digest(file, "sha256").digest())
    return digest.hexdigest()[:24]


def _tokenize(files: Sequence[Path], tokenizer: PlanTokenizer, folder: Path) -> None:
    """Writes a split's arrays under a temporary name and renames the folder."""
    partial = folder.with_name(f".{folder.name}.{os.getpid()}")
    shutil.rmtree(partial, ignore_errors=True)
    partial.mkdir(parents=True)
    records, entropies = _write_parts(files, tokenizer, partial)
    np.save(partial / "records.npy", np.array(records, dtype=np.int64))
    np.save(partial / "entropies.npy", np.array(entropies, dtype=np.float64))
    (partial / "index.json").write_text(json.dumps({"records": len(records)}) + "\n", encoding="utf-8")
    if folder.is_dir():
        shutil.rmtree(partial)
        return
    partial.rename(folder)


def _write_parts(files: Sequence[Path], tokenizer: PlanTokenizer, folder: Path) -> tuple[list[int], list[float]]:
    dtype = np.dtype(np.uint16 if tokenizer.vocab_size <= 1 << 16 else np.int32)
    records: list[int] = []
    entropies: list[float] = []
    lengths: dict[str, list[int]] = {part: [] for part in PARTS}
    streams = {part: (folder / f"{part}.raw").open("wb") for part in PARTS}
    for batch in read_rows(files, COLUMNS):
        records += batch["index"]
        entropies += [math.log(int(count)) for count in batch["plan_count"]]
        for part, rows in zip(PARTS, _encode_pairs(batch, tokenizer), strict=True):
            lengths[part] += map(len, rows)
            streams[part].write(np.concatenate(rows).astype(dtype).tobytes())
    for part, stream in streams.items():
        stream.close()
        _finish(folder, part, lengths[part], dtype)
    return records, entropies


def _encode_pairs(batch: dict[str, list[Any]], tokenizer: PlanTokenizer) -> tuple[list[Any], list[Any], list[Any]]:
    """Token ids of prompts, positives and negatives; the two completions of a pair follow the same prompt tokens."""
    prompts, words = batch["prompt"], batch["words"]
    shared, positives, _ = tokenizer.encode_records(prompts, batch["completion"], words)
    again, negatives, _ = tokenizer.encode_records(prompts, batch["negative"], words)
    for index, first, second in zip(batch["index"], shared, again, strict=True):
        if not np.array_equal(first, second):
            raise DataSetError(f"record {index}: its prompt has other tokens before its negative")
    return shared, positives, negatives


def _finish(folder: Path, part: str, lengths: list[int], dtype: np.dtype[Any]) -> None:
    """Turns a raw stream into `.npy` files without holding it in memory."""
    offsets = np.concatenate(([0], np.cumsum(lengths, dtype=np.int64)))
    np.save(folder / f"{part}.offsets.npy", offsets)
    raw = folder / f"{part}.raw"
    with (folder / f"{part}.tokens.npy").open("wb") as target, raw.open("rb") as source:
        header = {"descr": dtype.str, "fortran_order": False, "shape": (int(offsets[-1]),)}
        np.lib.format.write_array_header_1_0(target, header)
        shutil.copyfileobj(source, target)
    raw.unlink()
