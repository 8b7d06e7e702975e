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


def stepwise(planner: Planner, prompts: Sequence[str], completions: Sequence[str]) -> list[Stepwise]:
    """The probabilities of the steps of each completion after its prompt."""
    read = log_probabilities(planner, *planner.tokenizer.encode_records(prompts, completions)[:2])
    return [_cut(planner, tokens) for tokens in read]


@torch.inference_mode()
def log_probabilities(
    planner: Planner, prompts: Sequence[Any], completions: Sequence[Any]
) -> list[list[tuple[int, float]]]:
    """Each token of each completion with the logarithm of its probability, as far as the model's context goes."""
    if not len(prompts):
        return []
    room = [planner.model_context - len(prompt) for prompt in prompts]
    said = [ids[: max(left, 0)] for ids, left in zip(completions, room, strict=True)]
    rows = [Row(prompt, ids, scored=True) for prompt, ids in zip(prompts, said, strict=True)]
    batch = collate(rows, [], planner.tokenizer.end_id).to(planner.model.device)
    found = _logits(planner.model, batch).float().log_softmax(-1).gather(-1, batch.lm_labels[:, None])[:, 0]
    every = iter(found.tolist())
    return [list(zip(ids.tolist(), islice(every, len(ids)), strict=True)) for ids in said]


def _logits(model: Any, batch: Batch) -> torch.Tensor:
    """Logits (scored, vocabulary)."""
    if isinstance(model, LstmLMHeadModel):
        hidden = model.hidden_at(batch.input_ids, batch.lm_positions)
    else:
        hidden = hidden_at(model.transformer, batch.input_ids, batch.position_ids, batch.lm_positions, torch.float32)
    logits: torch.Tensor = model.lm_head(hidden)
    return logits


def _cut(planner: Planner, tokens: list[tuple[int, float]]) -> Stepwise:
    """Sums over the parts of each step."""
    tokenizer = planner.tokenizer
    step, state = (tokenizer.hf.convert_tokens_to_ids(word) for word in ("<ACTION>", "<STATE>"))
    operators: list[float] = []
    states: list[float] = []
    part = [0.0]  # what comes before the first step (a space, in some tokenizers) counts with its operator
    end = None
    for token, log_prob in tokens:
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
