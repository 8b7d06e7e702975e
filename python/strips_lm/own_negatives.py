"""A model's own wrong plans as negatives: a side file of a data set, by record index.

What the second head must tell apart is what the model itself draws, not what a corruption makes. The file is Parquet
with `index`, `prompt`, `words`, `negative`, `negative_kind` (`model-sample`) and `negative_verdict`. Writing it is
`sample_negatives`' concern; this module reads it, and needs no torch.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from strips_lm.dataset import Chain, DataSetError, PlanDataset, Ragged

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

    from numpy.typing import NDArray

    from strips_lm.tokenizer import PlanTokenizer

KIND = "model-sample"
"""The `negative_kind` of every row."""


@dataclass(frozen=True, slots=True)
class OwnNegative:
    """One wrong plan that a model wrote for a record's prompt."""

    index: int
    prompt: str
    words: list[str]
    negative: str
    negative_verdict: str


def write(path: Path, rows: Sequence[OwnNegative]) -> None:
    """Writes the file, whole or not at all."""
    columns = {name: [getattr(row, name) for row in rows] for name in OwnNegative.__slots__}
    part = path.with_name(path.name + ".part")
    pq.write_table(pa.table({**columns, "negative_kind": [KIND] * len(rows)}), part, compression="zstd")
    part.replace(path)


def with_negatives(
    data: PlanDataset, path: str | Path, tokenizer: PlanTokenizer, longest: int, *, share: float = 0.0, seed: int = 0
) -> PlanDataset:
    """The split with the file's negatives in place of their records' own; a pair is at most `longest` tokens.

    A negative that is too long, or whose record is left out, changes nothing. With a `share`, records without a
    negative of the file are left out by chance (`seed`) until those with one are that share of all.

    Raises:
        DataSetError: there is no such file, no record of it is in the split, or one has another prompt there; or the
            data is a mixture, in which an index names no record.
    """
    if data.mixed:
        raise DataSetError("`train.own_negatives` goes with one data set, not with a mixture of several")
    if not Path(path).is_file():
        raise DataSetError(f"{path}: no such file\nhint: `strips-lm sample-negatives` writes it")
    rows = pq.read_table(path, columns=["index", "prompt", "words", "negative"]).to_pydict()
    prompts, negatives, _ = tokenizer.encode_records(rows["prompt"], rows["negative"], rows["words"])
    places = {int(index): place for place, index in enumerate(data.index)}
    kept = set(data.kept.tolist())
    found: dict[int, np.ndarray] = {}
    for index, prompt, negative in zip(rows["index"], prompts, negatives, strict=True):
        place = places.get(index)
        if place not in kept or place is None or len(prompt) + len(negative) > longest:
            continue
        if not np.array_equal(prompt, data.prompts[place]):
            raise DataSetError(f"{path}: record {index} has another prompt in the data set")
        found[place] = negative
    if not found:
        raise DataSetError(f"{path}: none of its negatives belongs to a record that can be trained on")
    kept_now = _thinned(data.kept, found, share, seed) if share else data.kept
    return replace(data, negatives=_put(data.negatives, found), kept=kept_now)


def _thinned(kept: NDArray[np.int64], found: Collection[int], share: float, seed: int) -> NDArray[np.int64]:
    """All records that were found, and as many of the others that the former are the `share` of them."""
    own = np.isin(kept, np.fromiter(found, dtype=np.int64))
    others = min(round(len(found) * (1.0 - share) / share), int((~own).sum()))
    picked = np.random.default_rng((seed, 2)).choice(kept[~own], others, replace=False)
    return np.sort(np.concatenate((kept[own], picked)))


def _put(old: Ragged | Chain, new: dict[int, np.ndarray]) -> Ragged:
    """The sequences with some of them exchanged."""
    rows = [new.get(place, old[place]) for place in range(len(old))]
    offsets = np.concatenate(([0], np.cumsum([len(row) for row in rows], dtype=np.int64)))
    return Ragged(np.concatenate(rows).astype(old[0].dtype), offsets)
