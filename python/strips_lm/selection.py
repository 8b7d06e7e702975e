"""Which of the records at hand a step is made of: those on which the model has most left to learn.

What is left is a record's reducible loss (Mindermann et al. 2022): its loss less what no model could save. Others
estimate the latter by a second model; here the oracle knows it, as the logarithm of the number of plans that the
record's plan was drawn from. Reading a record costs a quarter to two fifths of training on it, and late in a run a
few records in a hundred hold most of what is left. Scores are of records as they are dressed for this very step, by the
weights of now.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import torch

from strips_lm.batches import cut_batches, share_batch
from strips_lm.loss import token_losses
from strips_lm.sharding import gathered

if TYPE_CHECKING:
    from collections.abc import Sequence

    from accelerate import Accelerator
    from numpy.typing import NDArray

    from strips_lm.batches import Group, Plan
    from strips_lm.dataset import PlanDataset
    from strips_lm.objective import Objective


class Selection:
    """Picks a step's records from those of several steps, the same in every process."""

    def __init__(self, accelerator: Accelerator, objective: Objective, data: PlanDataset, plan: Plan) -> None:
        """`objective` is the model out of its wrappers: no gradients are recorded, so that none are exchanged."""
        self.accelerator, self.objective, self.data, self.plan = accelerator, objective, data, plan

    def __call__(self, groups: Sequence[Group], records: NDArray[np.int64]) -> NDArray[np.int64]:
        """The places in `records`, ascending, of a step's worth of those with the highest reducible loss."""
        losses = self._losses([(group[0],) for group in groups]) - self.data.entropies[records]
        return np.sort(hardest(losses, self.data.lengths[records], self.plan))

    def _losses(self, groups: Sequence[Group]) -> NDArray[np.float64]:
        """(records) nats of each record's completion; every process reads its share and hears of the others'."""
        rank, world = self.accelerator.process_index, self.accelerator.num_processes
        found = np.zeros(len(groups))
        training = self.objective.training
        self.objective.eval()
        start = 0
        with gathered(self.objective):
            for cut in cut_batches(groups, self.plan.batch_tokens):
                mine = range(start + rank, start + len(cut), world)
                if mine:
                    found[mine] = self._read(cut[rank::world])
                start += len(cut)
        self.objective.train(training)
        if world == 1:
            return found
        total = self.accelerator.reduce(torch.from_numpy(found).to(self.accelerator.device), "sum")
        summed: NDArray[np.float64] = total.cpu().numpy()
        return summed

    @torch.no_grad()
    def _read(self, groups: Sequence[Group]) -> NDArray[np.float64]:
        """(groups) the loss of each group's positive."""
        batch = share_batch(groups, self.data.pad, self.plan).to(self.accelerator.device)
        losses = token_losses(self.objective.model, batch, self.objective.dtype).double().cpu().numpy()
        ends = np.cumsum([len(group[0].completion) for group in groups])
        summed: NDArray[np.float64] = np.add.reduceat(losses, np.concatenate(([0], ends[:-1])))
        return summed


def hardest(losses: NDArray[np.float64], lengths: NDArray[np.int64], plan: Plan) -> NDArray[np.int64]:
    """The places of the highest losses that make up a step of `plan`, highest first; of equal ones the first."""
    order = np.argsort(-losses, kind="stable")
    if plan.step_pairs:
        return order[: plan.step_pairs]
    return order[: 1 + int(np.searchsorted(np.cumsum(lengths[order]), plan.step_tokens))]
