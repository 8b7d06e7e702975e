"""Muon for the matrices inside the network, AdamW for the rest, in one optimiser of our own.

Muon (Jordan et al. 2024) replaces a matrix's momentum by its nearest semi-orthogonal matrix, found by five
Newton-Schulz steps, so that every direction moves by the same amount. Matrices of one shape are stacked and
orthogonalised together, and GPT-2's fused query-key-value matrix is taken apart first: each third is a map of its
own. Embeddings, heads, norms and biases follow AdamW. State: one momentum a matrix, two moments for the rest.
Several processes share the matrices out, and each hears from the others what they made of theirs.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, cast

import torch
from torch import distributed
from torch.optim import Optimizer
from torch.optim.adamw import adamw

from strips_lm.processor import multiplies_bfloat16
from strips_lm.sharding import local, share, whole

if TYPE_CHECKING:
    from collections.abc import Callable

    from torch import Tensor, nn

    from strips_lm.config import TrainConfig

NEWTON_SCHULZ = (3.4445, -4.7750, 2.0315)
"""Coefficients of the quintic step, tuned by Muon's author for steep growth of small singular values."""


def orthogonalise(matrices: Tensor, steps: int = 5) -> Tensor:
    """Approximate U Vᵀ of each U S Vᵀ in a stack (count, rows, columns); singular values end near 1."""
    tall = matrices.shape[-2] > matrices.shape[-1]
    x: Tensor = matrices.mT if tall else matrices
    x = x / (x.norm(dim=(-2, -1), keepdim=True) + 1e-7)
    a, b, c = NEWTON_SCHULZ
    for _ in range(steps):
        gram = x @ x.mT
        x = a * x + (b * gram + c * gram @ gram) @ x
    return x.mT if tall else x


class MuonAdamW(Optimizer):
    """One step: Muon on groups with `muon=True`, AdamW on the others."""

    def __init__(self, groups: list[dict[str, Any]], betas: tuple[float, float], eps: float, momentum: float) -> None:
        """Groups carry `params`, `lr`, `weight_decay`, `muon` and, for Muon, `parts` (thirds of a fused matrix)."""
        defaults = {"lr": 1e-3, "weight_decay": 0.0, "muon": False, "parts": 1}
        super().__init__(groups, {**defaults, "betas": betas, "eps": eps, "momentum": momentum})

    @torch.no_grad()
    def step(self, closure: Callable[[], float] | None = None) -> None:  # type: ignore[override]
        """Update every parameter that has a gradient."""
        if closure is not None:
            closure()
        self._muon([group for group in self.param_groups if group["muon"]])
        for group in self.param_groups:
            if not group["muon"]:
                self._adamw(group)

    def _muon(self, groups: list[dict[str, Any]]) -> None:
        by_shape: dict[tuple[int, ...], list[tuple[tuple[dict[str, Any], Tensor, int], Tensor]]] = {}
        for group in groups:
            for parameter in group["params"]:
                if parameter.grad is not None:
                    direction = whole(self._nesterov(parameter, group["momentum"]), parameter)
                    for index, part in enumerate(direction.chunk(group["parts"], dim=1)):
                        by_shape.setdefault(tuple(part.shape), []).append(((group, parameter, index), part))
        made = _orthogonalised([[part for _, part in members] for members in by_shape.values()])
        for ((rows, columns), members), updates in zip(by_shape.items(), made, strict=True):
            for ((group, parameter, index), _), update in zip(members, updates, strict=True):
                target = local(parameter).chunk(group["parts"], dim=1)[index]
                if group["weight_decay"]:
                    target.mul_(1.0 - group["lr"] * group["weight_decay"])
                scale = group["lr"] * max(1.0, columns / rows) ** 0.5
                target.add_(share(update, parameter).to(target.dtype), alpha=-scale)

    def _nesterov(self, parameter: Tensor, momentum: float) -> Tensor:
        state = self.state[parameter]
        if not state:
            state["momentum"] = torch.zeros_like(local(parameter))
        grad = local(cast("Tensor", parameter.grad))
        state["momentum"].lerp_(grad, 1.0 - momentum)
        return grad.lerp(state["momentum"], momentum)

    def _adamw(self, group: dict[str, Any]) -> None:
        parameters = [parameter for parameter in group["params"] if parameter.grad is not None]
        self.make_state(parameters)
        if parameters and parameters[0].is_cuda:
            self.adamw_fused(group, parameters)
            return
        for parameter in parameters:
            self._adamw_one(group, parameter)

    def make_state(self, parameters: list[Tensor]) -> None:
        """Zero moments for AdamW's parameters that have none."""
        for parameter in parameters:
            if not self.state[parameter]:
                zeros = {name: torch.zeros_like(local(parameter)) for name in ("mean", "square")}
                self.state[parameter].update(step=torch.zeros(()), **zeros)

    def _adamw_one(self, group: dict[str, Any], parameter: Tensor) -> None:
        first, second = group["betas"]
        state, grad = self.state[parameter], local(cast("Tensor", parameter.grad))
        parameter = local(parameter)
        state["step"] += 1
        state["mean"].lerp_(grad, 1.0 - first)
        state["square"].mul_(second).addcmul_(grad, grad, value=1.0 - second)
        count = float(state["step"])
        root = (state["square"] / (1.0 - second**count)).sqrt_().add_(group["eps"])
        parameter.mul_(1.0 - group["lr"] * group["weight_decay"])
        parameter.addcdiv_(state["mean"], root, value=-group["lr"] / (1.0 - first**count))

    def adamw_fused(self, group: dict[str, Any], parameters: list[Tensor]) -> None:
        """AdamW by PyTorch's kernel for all parameters at once; a GPU would wait for the launches of single ones."""
        states = [self.state[parameter] for parameter in parameters]
        for state, parameter in zip(states, parameters, strict=True):
            state["step"] = state["step"].to(parameter.device)
        adamw(
            [local(parameter) for parameter in parameters],
            [local(cast("Tensor", parameter.grad)) for parameter in parameters],
            [state["mean"] for state in states],
            [state["square"] for state in states],
            [],
            [state["step"] for state in states],
            fused=True,
            amsgrad=False,
            beta1=group["betas"][0],
            beta2=group["betas"][1],
            lr=group["lr"],
            weight_decay=group["weight_decay"],
            eps=group["eps"],
            maximize=False,
        )


def _orthogonalised(stacks: list[list[Tensor]]) -> list[Tensor]:
    """What is nearest to each matrix, a stack (count, rows, columns) for each list of matrices of one shape."""
    world = distributed.get_world_size() if distributed.is_available() and distributed.is_initialized() else 1
    rank = distributed.get_rank() if world > 1 else 0
    own = []
    for members in stacks:
        # The last ones of a count that does not divide are given to all that would have none.
        count = -(-len(members) // world)
        mine = [members[min(index, len(members) - 1)] for index in range(rank * count, (rank + 1) * count)]
        own.append(orthogonalise(torch.stack(mine).to(_newton_type(mine[0]))))
    if world == 1 or not own:
        return own
    flat = torch.cat([updates.flatten() for updates in own])
    heard = flat.new_empty(world, len(flat))
    distributed.all_gather_into_tensor(heard.view(-1), flat)
    made = []
    start = 0
    for members, updates in zip(stacks, own, strict=True):
        parts = heard[:, start : start + updates.numel()].reshape(-1, *updates.shape[1:])
        made.append(parts[: len(members)])
        start += updates.numel()
    return made


def _newton_type(parameter: Tensor) -> torch.dtype:
    """bfloat16 is enough for Newton-Schulz where it is fast; small float64 models of the tests keep their type."""
    quick = parameter.dtype == torch.float32 and multiplies_bfloat16(parameter.device)
    return torch.bfloat16 if quick else parameter.dtype


def split_parameters(model: nn.Module) -> tuple[list[Tensor], list[Tensor], list[Tensor]]:
    """(fused query-key-value matrices, other inner matrices, everything else) of a model, tied weights once."""
    fused: list[Tensor] = []
    matrices: list[Tensor] = []
    rest: list[Tensor] = []
    for name, parameter in model.named_parameters():
        inner = parameter.ndim == 2 and (".h." in name or name.startswith("lstm."))
        (fused if inner and "c_attn" in name else matrices if inner else rest).append(parameter)
    return fused, matrices, rest


def make_optimizer(model: nn.Module, train: TrainConfig) -> MuonAdamW:
    """The optimiser that a configuration asks for; each group's `peak` is the rate that a schedule scales."""
    fused, matrices, rest = split_parameters(model)
    if train.optimizer == "adam":
        fused, matrices, rest = [], [], [*fused, *matrices, *rest]
    muon = {"muon": True, "peak": train.matrix_lr}
    groups: list[dict[str, Any]] = [
        {"params": fused, "parts": 3, **muon},
        {"params": matrices, "parts": 1, **muon},
        {"params": rest, "muon": False, "peak": train.lr},
    ]
    filled = [{**group, "lr": group["peak"], "weight_decay": train.weight_decay} for group in groups if group["params"]]
    return MuonAdamW(filled, betas=(train.betas[0], train.betas[1]), eps=train.eps, momentum=train.momentum)
