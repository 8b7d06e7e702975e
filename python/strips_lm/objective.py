"""The model together with its losses, and how both are measured on a validation split."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import torch
from torch import nn

from strips_lm.batches import Dress, Plan, build_step
from strips_lm.loss import Losses, batch_losses

if TYPE_CHECKING:
    from transformers import PreTrainedModel

    from strips_lm.batches import Batch, Step
    from strips_lm.dataset import PlanDataset


class Objective(nn.Module):
    """Calls the losses through `forward`, which is where data-parallel wrappers hook in."""

    def __init__(self, model: PreTrainedModel, dtype: torch.dtype, *, compiled: bool = False) -> None:
        super().__init__()
        self.model = model
        self.dtype, self.compiled = dtype, compiled

    def forward(self, batch: Batch) -> Losses:
        """The losses of a batch, summed."""
        return batch_losses(self.model, batch, self.dtype, compiled=self.compiled)


@dataclass(frozen=True, slots=True)
class Measure:
    """What a model does on held-out records."""

    lm_loss: float
    """Nats a scored token."""
    mc_loss: float | None
    """Nats a pair; None for models without the second head."""
    mc_accuracy: float | None
    """Share of pairs in which the positive scores higher; None for models without that head."""


def validation_step(data: PlanDataset, records: int, batch_tokens: int, choices: bool) -> Step:
    """The first `records` of a split as one step, as they stand, with their negatives where the model chooses."""
    plan = Plan(step_tokens=1, step_pairs=0, batch_tokens=batch_tokens)
    picked = data.kept[:records]
    picked = picked[data.lengths[picked].argsort(kind="stable")]
    return build_step(data, picked, plan, Dress(mc_share=1.0 if choices else 0.0), (0,))


@torch.no_grad()
def measure(objective: Objective, step: Step, device: torch.device) -> Measure:
    """Mean losses over a validation step."""
    training = objective.training
    objective.eval()
    losses = [objective(batch.to(device)) for batch in step.batches]
    objective.train(training)
    lm = sum(float(part.lm) for part in losses) / step.tokens
    if not step.pairs:
        return Measure(lm, None, None)
    mc = sum(float(part.mc) for part in losses) / step.pairs
    return Measure(lm, mc, sum(int(part.right) for part in losses) / step.pairs)
