"""Single steps of a model's own, right and wrong, for its second head to tell apart: a file beside its checkpoints.

A plan holds where each of its steps does: the action can be applied, the state after it is the true one, and it ends
where the goal holds. So a head that judges one step at a time, asked from the state before it as `replan` asks, has to
learn one thing, of which every sample gives several examples; and what it must tell apart is what the model itself
writes, not what a corruption makes. The file is Parquet with `prompt` (from the state before the step), `words`,
`step`, `right` and `verdict`. Drawing them is `sample_steps`' concern; this module reads them, and needs no torch.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from strips_lm.dataset import Ragged, StepPool
from strips_lm.tokenizer import encode_each

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from strips_lm.tokenizer import PlanTokenizer

FILE = "own-steps.parquet"
"""What it is called."""

HELD = 20
"""One in so many steps is held back, to measure the head on."""


@dataclass(frozen=True, slots=True)
class OwnStep:
    """One step that a model wrote, as the first after its prompt."""

    prompt: str
    words: list[str]
    step: str
    """`<ACTION> … <STATE> …`, with the end token where the text ends after it."""
    right: bool
    verdict: str
    """`right`, or what is wrong: the validator's outcome, or `wrong_state`."""


def write(path: Path, rows: Sequence[OwnStep]) -> None:
    """Writes the file, whole or not at all."""
    part = path.with_name(path.name + ".part")
    columns = {field.name: [getattr(row, field.name) for row in rows] for field in fields(OwnStep)}
    pq.write_table(pa.table(columns), part, compression="zstd")
    part.replace(path)


def read(path: str | Path, tokenizer: PlanTokenizer, longest: int) -> tuple[StepPool, StepPool]:
    """The file's steps to train on and those held back; none is longer than `longest` tokens with its prompt."""
    table = pq.read_table(path, columns=["prompt", "words", "step", "right"]).to_pydict()
    rows = encode_each(tokenizer.encode_records, table["prompt"], table["step"], table["words"])
    fit = [i for i, row in enumerate(rows) if row is not None and len(row[0]) + len(row[1]) <= longest]
    right = np.array([table["right"][i] for i in fit], dtype=bool)
    prompts, steps = (_ragged([rows[i][part] for i in fit]) for part in (0, 1))  # type: ignore[index]
    held = np.arange(len(fit)) % HELD == 0
    training, measured = [
        StepPool(prompts, steps, np.flatnonzero(right & chosen), np.flatnonzero(~right & chosen))
        for chosen in (~held, held)
    ]
    return training, measured


def _ragged(rows: Sequence[np.ndarray]) -> Ragged:
    offsets = np.concatenate(([0], np.cumsum([len(row) for row in rows], dtype=np.int64)))
    return Ragged(np.concatenate(rows) if rows else np.zeros(0, dtype=np.int32), offsets)
