"""The stateful decoder for the LSTM language model: the three calls of the static cache, over two state tensors."""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor
from torch.nn.utils.rnn import pack_padded_sequence


class LstmDecoder:
    """Next-token logits of an LSTM language model (`embedding`, `lstm`, `lm_head`) over rows of state."""

    def __init__(self, model: Any, rows: int) -> None:
        """A decoder whose `rows` rows have read nothing."""
        self.model = model
        self.context: int = model.config.max_position_embeddings
        self.lengths = torch.zeros(rows, dtype=torch.long, device=model.device)
        lstm = model.lstm
        shape = lstm.num_layers, rows, lstm.hidden_size
        self.hidden = torch.zeros(shape, device=model.device, dtype=model.dtype)
        self.cell = torch.zeros_like(self.hidden)

    def clear(self, first: int, count: int) -> None:
        """Forget what the rows `first` to `first + count` have read."""
        self.lengths[first : first + count] = 0
        self.hidden[:, first : first + count] = 0
        self.cell[:, first : first + count] = 0

    def rewind(self, row: int, count: int) -> int:
        """Forget all that a row has read, as no earlier state is kept; what is left is nothing."""
        del count
        self.clear(row, 1)
        return 0

    def move(self, sources: Tensor, targets: Tensor) -> None:
        """Copy the rows `sources` over the rows `targets`."""
        for state in (self.hidden, self.cell):
            state[:, targets] = state[:, sources]
        self.lengths[targets] = self.lengths[sources]

    def feed(self, first: int, ids: Tensor, counts: Tensor) -> Tensor:
        """Append tokens (n, m), padded to the right, `counts` of them real; logits (n, vocabulary) after the last."""
        rows = slice(first, first + len(ids))
        state = self.hidden[:, rows].contiguous(), self.cell[:, rows].contiguous()
        packed = pack_padded_sequence(self.model.embedding(ids), counts.cpu(), batch_first=True, enforce_sorted=False)
        _, (hidden, cell) = self.model.lstm(packed, state)
        self.hidden[:, rows], self.cell[:, rows] = hidden, cell
        self.lengths[rows] += counts
        logits: Tensor = self.model.lm_head(hidden[-1])
        return logits
