"""How probable a model finds each step of a text, whoever wrote it.

A step's tokens run from `<ACTION>` to the next one: first the operator, then from `<STATE>` on the state. Each part's
probability is the product of its tokens', given the prompt and all before it. Price: one forward pass over the texts.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import islice
from typing import TYPE_CHECKING, Any

import torch

from strips_lm.batches import Batch, Row, collate
from strips_lm.forward import hidden_at
from strips_lm.lstm import LstmLMHeadModel

if TYPE_CHECKING:
    from collections.abc import Sequence

    from strips_lm.generate import Planner


@dataclass(frozen=True, slots=True)
class Stepwise:
    """One text's probabilities; a text cut off by the model's context has fewer of them than steps."""

    operators: list[float]
    """Of each step's operator."""
    states: list[float]
    """Of the state after it; 1 where the text says none."""
    end: float | None
    """Of ending where it ends; `None` where it does not end."""


@torch.inference_mode()
def stepwise(planner: Planner, prompts: Sequence[str], completions: Sequence[str]) -> list[Stepwise]:
    """The probabilities of the steps of each completion after its prompt."""
    if not prompts:
        return []
    asked, said, _ = planner.tokenizer.encode_records(prompts, completions)
    room = [planner.model_context - len(prompt) for prompt in asked]
    said = [ids[: max(left, 0)] for ids, left in zip(said, room, strict=True)]
    rows = [Row(prompt, ids, scored=True) for prompt, ids in zip(asked, said, strict=True)]
    batch = collate(rows, [], planner.tokenizer.end_id).to(planner.model.device)
    found = _logits(planner.model, batch).float().log_softmax(-1).gather(-1, batch.lm_labels[:, None])[:, 0]
    every = iter(found.tolist())
    return [_cut(planner, ids.tolist(), list(islice(every, len(ids)))) for ids in said]


def _logits(model: Any, batch: Batch) -> torch.Tensor:
    """Logits (scored, vocabulary)."""
    if isinstance(model, LstmLMHeadModel):
        hidden = model.hidden_at(batch.input_ids, batch.lm_positions)
    else:
        hidden = hidden_at(model.transformer, batch.input_ids, batch.position_ids, batch.lm_positions, torch.float32)
    logits: torch.Tensor = model.lm_head(hidden)
    return logits


def _cut(planner: Planner, ids: list[int], log_probs: list[float]) -> Stepwise:
    """Sums over the parts of each step."""
    tokenizer = planner.tokenizer
    step, state = (tokenizer.hf.convert_tokens_to_ids(word) for word in ("<ACTION>", "<STATE>"))
    operators: list[float] = []
    states: list[float] = []
    part = [0.0]  # what comes before the first step (a space, in some tokenizers) counts with its operator
    end = None
    for token, log_prob in zip(ids, log_probs, strict=True):
        if token == tokenizer.end_id:
            end = log_prob
            break
        if token == step:
            operators.append(0.0 if operators else part[-1])
            states.append(0.0)
            part = operators
        elif token == state and states:
            part = states
        part[-1] += log_prob
    return Stepwise(list(map(math.exp, operators)), list(map(math.exp, states)), None if end is None else math.exp(end))
