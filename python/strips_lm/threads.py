"""How many threads to train with, by a short measured trial.

OpenMP's barriers wait for the slowest thread: on a machine whose cores are busy with other work two threads were found
ten times slower than one (docs/experiments.md), on a quiet one nearly twice as fast. Nothing but a trial tells.
"""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

import torch

from strips_lm.batches import Dress, Plan, build_step

if TYPE_CHECKING:
    from strips_lm.dataset import PlanDataset
    from strips_lm.objective import Objective

ROWS = 8
"""Records of a trial: enough for the matrix products to count, few enough to take a fraction of a second."""


def choose_threads(objective: Objective, data: PlanDataset) -> int:
    """Sets PyTorch's threads to one or to as many as it has, whichever trains faster now, and returns the number."""
    most = torch.get_num_threads()
    if most > 1:
        times = {threads: _seconds(objective, data, threads) for threads in (1, most)}
        torch.set_num_threads(min(times, key=lambda threads: times[threads]))
    return torch.get_num_threads()


def _seconds(objective: Objective, data: PlanDataset, threads: int) -> float:
    """The faster of two forward and backward passes over a few records, after one that warms up."""
    torch.set_num_threads(threads)
    plan = Plan(step_tokens=1, step_pairs=ROWS, batch_tokens=1 << 20)
    step = build_step(data, data.kept[:ROWS], plan, Dress(), (0,))
    times = []
    for _ in range(3):
        start = time.monotonic()
        objective(step.batches[0]).lm.backward()
        times.append(time.monotonic() - start)
    objective.zero_grad()
    return min(times[1:])
