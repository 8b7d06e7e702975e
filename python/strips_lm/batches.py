"""From tokenized pairs to batches: order by (seed, epoch), buckets of like length, a token budget.

An epoch is one permutation of the records, a pure function of (seed, epoch). It is cut into steps of `step_tokens`
scored and unscored tokens (or of `step_pairs` pairs); the records of a step are sorted by length and cut into
batches of at most `batch_tokens` padded tokens, and every process takes each `world`-th row of a batch. What a
record looks like (slots renumbered, position offset, whether its negative comes along) is a function of (seed, epoch,
record), so that a run can go on from any step without any other state. This module knows numbers, not text.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

import numpy as np
import torch

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray
    from torch import Tensor

    from strips_lm.dataset import PlanDataset


@dataclass(frozen=True, slots=True, kw_only=True)
class Batch:
    """Rows padded on the right, and which of their positions the losses read."""

    input_ids: Tensor
    """(rows, length) token ids."""
    position_ids: Tensor
    """(rows, length) positions, each row from its own offset on."""
    lm_positions: Tensor
    """(scored,) flat indices into (rows * length) of the positions that predict a scored token."""
    lm_labels: Tensor
    """(scored,) the tokens they should predict."""
    mc_token_ids: Tensor
    """(pairs, choices) flat indices of each choice's last token; the positive comes first."""
    mc_labels: Tensor
    """(pairs,) which choice is the positive: always 0."""

    def to(self, device: torch.device) -> Batch:
        """The same batch on another device."""
        return Batch(**{field.name: getattr(self, field.name).to(device) for field in fields(self)})


@dataclass(frozen=True, slots=True)
class Row:
    """One token sequence: prompt and completion, and how it takes part in the losses."""

    prompt: NDArray[np.integer]
    completion: NDArray[np.integer]
    scored: bool
    """Whether its completion's tokens count in the LM loss (positives only)."""
    offset: int = 0
    """Position of its first token."""

    def __len__(self) -> int:
        return len(self.prompt) + len(self.completion)


def collate(rows: Sequence[Row], pairs: Sequence[Sequence[int]], pad: int) -> Batch:
    """Pad rows to the longest and index what the losses read; `pairs` lists the rows of each choice, positive first."""
    length = max(map(len, rows))
    ids = np.full((len(rows), length), pad, dtype=np.int64)
    scored, labels, last = [], [], []
    for index, row in enumerate(rows):
        ids[index, : len(row)] = np.concatenate((row.prompt, row.completion))
        start = index * length + len(row.prompt) - 1
        last.append(index * length + len(row) - 1)
        if row.scored:
            scored.append(np.arange(start, start + len(row.completion)))
            labels.append(row.completion)
    offsets = np.array([row.offset for row in rows])
    return Batch(
        input_ids=torch.from_numpy(ids),
        position_ids=torch.from_numpy(np.arange(length)[None, :] + offsets[:, None]),
        lm_positions=_long(scored),
        lm_labels=_long(labels),
        mc_token_ids=torch.tensor([[last[row] for row in pair] for pair in pairs], dtype=torch.long).reshape(
            len(pairs), -1 if pairs else 0
        ),
        mc_labels=torch.zeros(len(pairs), dtype=torch.long),
    )


def _long(parts: list[NDArray[np.integer]]) -> Tensor:
    return torch.from_numpy(np.concatenate(parts).astype(np.int64)) if parts else torch.zeros(0, dtype=torch.long)
