"""How well a model predicts the plans of a suite, and how well its second head tells them from corruptions.

Cross-entropy is summed over the completions' tokens alone (actions, states, the end), in float32, at positions from 0
on. Price: one forward pass over each positive and, with a second head, each negative.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import torch
from torch.nn import functional as F

from strips_lm.batches import Batch, Row, collate, padded_parts
from strips_lm.evaluate.results import Likelihood
from strips_lm.forward import hidden_at
from strips_lm.lstm import LstmLMHeadModel
from strips_lm.rerank import by_steps, log_chances

if TYPE_CHECKING:
    from collections.abc import Sequence

    from strips_lm.evaluate.suites import Item
    from strips_lm.generate import Planner


@dataclass(slots=True)
class _Sums:
    """What is added up over the batches."""

    nats: float = 0.0
    tokens: int = 0
    records: int = 0
    floor_nats: float = 0.0
    by_negative: dict[str, list[int]] = field(default_factory=dict)

    def count(self, items: Sequence[Item], better: Sequence[bool]) -> None:
        """Adds choices, each between an item's plan and its corruption."""
        for item, right in zip(items, better, strict=True):
            counts = self.by_negative.setdefault(item.negative_kind, [0, 0])
            counts[0] += right
            counts[1] += 1


def measure(planner: Planner, name: str, suite: str, items: Sequence[Item]) -> Likelihood:
    """Perplexity and multiple choice of one model on the pairs of one suite."""
    pairs = _encode(planner, items)
    kept = [pair for pair in pairs if max(map(len, pair.rows)) <= planner.model_context]
    sums = _Sums()
    for part in padded_parts([len(pair.rows) * max(map(len, pair.rows)) for pair in kept]):
        _add(planner, [kept[i] for i in part], sums)
    if planner.judges_steps:
        sums.count([pair.item for pair in kept], _by_steps(planner, [pair.item for pair in kept]))
    return _finish(sums, name, suite, left_out=len(pairs) - len(kept))


@dataclass(frozen=True, slots=True)
class _Pair:
    """A plan and, where the model has a second head that reads it, its corruption, as rows of tokens."""

    item: Item
    rows: tuple[Row, ...]


def _encode(planner: Planner, items: Sequence[Item]) -> list[_Pair]:
    """The pairs as tokens; both completions follow the same prompt."""
    prompts, words = [item.prompt for item in items], [item.words for item in items]
    encode = planner.tokenizer.encode_records
    asked, right, _ = encode(prompts, [item.completion for item in items], words)
    rows = [[Row(prompt, ids, scored=True)] for prompt, ids in zip(asked, right, strict=True)]
    if planner.has_head and not planner.judges_steps:
        _, wrong, _ = encode(prompts, [item.negative for item in items], words)
        for row, prompt, ids in zip(rows, asked, wrong, strict=True):
            row.append(Row(prompt, ids, scored=False))
    return [_Pair(item, tuple(row)) for item, row in zip(items, rows, strict=True)]


@torch.inference_mode()
def _add(planner: Planner, pairs: list[_Pair], sums: _Sums) -> None:
    """One batch through the model and into the sums."""
    rows = [row for pair in pairs for row in pair.rows]
    width = len(pairs[0].rows)
    choices = [range(i, i + width) for i in range(0, len(rows), width)] if width > 1 else []
    batch = collate(rows, choices, planner.tokenizer.end_id).to(planner.model.device)
    logits, better = _forward(planner.model, batch)
    sums.nats += float(F.cross_entropy(logits, batch.lm_labels, reduction="sum"))
    sums.tokens += len(batch.lm_labels)
    sums.records += len(pairs)
    sums.floor_nats += sum(math.log(pair.item.plan_count) for pair in pairs)
    if better:
        sums.count([pair.item for pair in pairs], better)


def _by_steps(planner: Planner, items: Sequence[Item]) -> list[bool]:
    """For each plan and its corruption, whether the head finds the plan's steps likelier to hold."""
    prompts = [item.prompt for item in items]
    right = by_steps(log_chances, planner, prompts, [item.completion for item in items])
    wrong = by_steps(log_chances, planner, prompts, [item.negative for item in items])
    return [one > other for one, other in zip(right, wrong, strict=True)]


def _forward(model: Any, batch: Batch) -> tuple[torch.Tensor, list[bool]]:
    """Logits (scored, vocabulary), and for each pair whether its positive scored higher."""
    scored = len(batch.lm_positions)
    if isinstance(model, LstmLMHeadModel):
        return model.lm_head(model.hidden_at(batch.input_ids, batch.lm_positions)), []
    at = torch.cat((batch.lm_positions, batch.mc_token_ids.flatten()))
    hidden = hidden_at(model.transformer, batch.input_ids, batch.position_ids, at, torch.float32)
    logits = model.lm_head(hidden[:scored])
    if len(batch.mc_labels) == 0:
        return logits, []
    scores = model.multiple_choice_head.summary(hidden[scored:]).view(len(batch.mc_labels), -1)
    return logits, (scores[:, 0] > scores[:, 1]).tolist()


def _finish(sums: _Sums, name: str, suite: str, left_out: int) -> Likelihood:
    """Sums in nats to perplexities and bits."""
    bits = math.log(2)
    return Likelihood(
        model=name,
        suite=suite,
        records=sums.records,
        left_out=left_out,
        tokens=sums.tokens,
        perplexity=math.exp(min(sums.nats / max(sums.tokens, 1), 700.0)),
        floor=math.exp(sums.floor_nats / max(sums.tokens, 1)),
        bits_per_plan=sums.nats / bits / max(sums.records, 1),
        floor_bits_per_plan=sums.floor_nats / bits / max(sums.records, 1),
        choices=sum(pairs for _, pairs in sums.by_negative.values()),
        choices_right=sum(right for right, _ in sums.by_negative.values()),
        by_negative=dict(sorted(sums.by_negative.items())),
    )
