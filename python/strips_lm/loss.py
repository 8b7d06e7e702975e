"""The two losses of the report and one of our own, as sums that add up over any cut of a step into batches.

LM: the cross-entropy of the scored tokens, divided by the scored tokens of the whole optimisation step.
Multiple choice: the cross-entropy over the choices of a pair, read at each choice's last token, divided by the
pairs of the whole step. L = lm_weight * L_lm + mc_weight * L_mc. Sums over batches, accumulation steps and processes
are therefore the same number whatever the cut. Only scored positions reach the LM head.

A third, of our own, is for models that spell states out: what each atom of a state is to the goal, and what the goal
lacks after each state (`strips_lm.goal_targets`), told to the layers on the way; divided as the first.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import torch
from torch.nn import functional as F

from strips_lm.forward import final_norm, hidden_at, rounded
from strips_lm.lstm import LstmLMHeadModel

if TYPE_CHECKING:
    from collections.abc import Sequence

    from torch import Tensor

    from strips_lm.batches import Batch
    from strips_lm.goal_targets import GoalTargets


@dataclass(frozen=True, slots=True)
class Losses:
    """Summed losses of one batch, with what they were summed over."""

    lm: Tensor
    """Sum of the cross-entropies (nats) of the scored tokens."""
    mc: Tensor
    """Sum of the cross-entropies (nats) over each pair's choices."""
    tokens: int
    """Scored tokens of this batch."""
    pairs: int
    """Pairs of this batch."""
    right: Tensor
    """Pairs whose positive scored highest."""
    goal: Tensor
    """Sum of the losses (nats) of what the layers are told of goals."""


def batch_losses(model: Any, batch: Batch, dtype: torch.dtype = torch.float32, *, compiled: bool = False) -> Losses:
    """The losses of one batch, summed; the multiple-choice sum is zero for models without that head."""
    tokens, pairs = len(batch.lm_positions), len(batch.mc_labels)
    at = torch.cat((batch.lm_positions, batch.mc_token_ids.flatten()))
    inputs: list[Tensor] = []
    hidden = _hidden(model, batch, at, dtype, compiled, inputs=inputs if batch.goal else None)
    lm = _lm_losses(model, hidden[:tokens], batch.lm_labels).sum()
    goal = _goal_loss(model, inputs, batch.goal) if batch.goal else lm.new_zeros(())
    if pairs == 0:
        return Losses(lm, _idle_head(model, lm), tokens, 0, lm.new_zeros(()), goal)
    logits = model.multiple_choice_head.summary(hidden[tokens:].to(_weight_type(model))).view(pairs, -1)
    mc = _step_losses(logits) if judges_steps(model) else F.cross_entropy(logits, batch.mc_labels, reduction="sum")
    right = (logits.argmax(dim=-1) == batch.mc_labels).sum()
    return Losses(lm, mc, tokens, pairs, right, goal)


def token_losses(model: Any, batch: Batch, dtype: torch.dtype = torch.float32) -> Tensor:
    """(scored,) the cross-entropy (nats) of each scored token, row after row."""
    return _lm_losses(model, _hidden(model, batch, batch.lm_positions, dtype, compiled=False), batch.lm_labels)


def _goal_loss(model: Any, inputs: Sequence[Tensor], goal: GoalTargets) -> Tensor:
    """The summed losses (nats) of what the layers are told, which they say by the language model's own head.

    Of an atom what it is to the goal, half-way: a cross-entropy. Of a state what the goal lacks after it, three
    quarters of the way, with atoms told: the divergence from a uniform draw among the words, which is zero at best.
    """
    half, late = inputs[len(inputs) // 2], inputs[3 * len(inputs) // 4]
    relations = _lm_losses(model, final_norm(model.transformer, half[goal.atoms]), goal.relations).sum()
    chances = _logits(model, final_norm(model.transformer, late[goal.states])).log_softmax(-1)
    counts = goal.lacking.bincount(minlength=len(goal.states)).to(chances.dtype)[goal.lacking]
    return relations - ((chances[goal.lacking, goal.words] + counts.log()) / counts).sum()


def _idle_head(model: Any, lm: Tensor) -> Tensor:
    """Zero by way of the second head, if any: data-parallel wrappers wait for every parameter's gradient."""
    head = getattr(model, "multiple_choice_head", None)
    return lm.new_zeros(()) if head is None else 0.0 * sum(weight.sum() for weight in head.parameters())


def judges_steps(model: Any) -> bool:
    """Whether the second head says of a single step whether it holds, not which of several texts is the right one."""
    return bool(getattr(model.config, "judges_steps", False))


def _step_losses(logits: Tensor) -> Tensor:
    """The summed losses (nats) of pairs of a right and a wrong step, (pairs, 2): a mean over a pair's two steps."""
    truth = torch.zeros_like(logits)
    truth[:, 0] = 1.0
    return F.binary_cross_entropy_with_logits(logits, truth, reduction="sum") / logits.shape[1]


def weighted(
    losses: Losses, step_tokens: int, step_pairs: int, lm_weight: float, mc_weight: float, *, goal_weight: float = 0.0
) -> Tensor:
    """This batch's share of the step's loss L = lm_weight * L_lm + mc_weight * L_mc + goal_weight * L_goal."""
    read = losses.lm * lm_weight + losses.goal * goal_weight
    return read / max(step_tokens, 1) + losses.mc * (mc_weight / max(step_pairs, 1))


def _hidden(
    model: Any, batch: Batch, at: Tensor, dtype: torch.dtype, compiled: bool, *, inputs: list[Tensor] | None = None
) -> Tensor:
    if isinstance(model, LstmLMHeadModel):
        return model.hidden_at(batch.input_ids, at)
    ids, places, blocks, borrowed = batch.input_ids, batch.position_ids, batch.blocks, batch.borrowed
    return hidden_at(
        model.transformer, ids, places, at, dtype, blocks=blocks, borrowed=borrowed, compiled=compiled, inputs=inputs
    )


def _lm_losses(model: Any, hidden: Tensor, labels: Tensor) -> Tensor:
    return F.cross_entropy(_logits(model, hidden), labels, reduction="none")


def _logits(model: Any, hidden: Tensor) -> Tensor:
    """(n, vocabulary) what the language model's head says, in the parameters' own type."""
    weight = model.lm_head.weight.to(hidden.dtype)
    bias = getattr(model.lm_head, "bias", None)
    logits = F.linear(rounded(hidden), weight, None if bias is None else bias.to(hidden.dtype))[: len(hidden)]
    return logits.to(_weight_type(model))


def _weight_type(model: Any) -> torch.dtype:
    """The parameters' own type: losses are computed in it, whatever the layers ran in."""
    kind: torch.dtype = model.lm_head.weight.dtype
    return kind
