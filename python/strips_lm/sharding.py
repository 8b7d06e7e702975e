"""Sharded training (FSDP): each process holds its share of weights, gradients and optimiser state.

PyTorch's `fully_shard` gathers the weights for a pass and spreads the gradients' sums; `local`, `whole` and `share` are
what an optimiser and a checkpoint need besides. All of them hand plain tensors back as they are, so that their callers
know nothing of sharding, and import nothing: a PyTorch without `torch.distributed` trains in one process as ever.
`whole` is called by every process, or by none.
"""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, TypeGuard

import torch
from torch import distributed

if TYPE_CHECKING:
    from collections.abc import Iterator

    from torch import Tensor, nn
    from torch.distributed.fsdp import FSDPModule
    from torch.distributed.tensor import DTensor


def shard(module: nn.Module, device: torch.device) -> None:
    """Has the processes share a module's parameters out, in place."""
    from torch.distributed.device_mesh import init_device_mesh  # noqa: PLC0415  (see above)
    from torch.distributed.fsdp import fully_shard  # noqa: PLC0415

    sharded: Any = fully_shard(module, mesh=init_device_mesh(device.type, (distributed.get_world_size(),)))
    if device.type == "cpu":
        sharded.set_force_sum_reduction_for_comms(True)  # gloo knows no average


def local(tensor: Tensor) -> Tensor:
    """This process's share of a parameter or gradient, in place."""
    return tensor.to_local() if _is_shared(tensor) else tensor


def full(tensor: Tensor) -> Tensor:
    """All of a tensor that knows how it is shared out."""
    return tensor.full_tensor() if _is_shared(tensor) else tensor


def whole(value: Tensor, parameter: Tensor) -> Tensor:
    """All of what `value` is this process's share of, shared out as `parameter` is."""
    if not _is_shared(parameter):
        return value
    from torch.distributed.tensor import DTensor  # noqa: PLC0415

    mesh, placements = parameter.device_mesh, parameter.placements
    shared = DTensor.from_local(value, mesh, placements, shape=parameter.shape, stride=parameter.stride())
    return shared.full_tensor()


def share(value: Tensor, parameter: Tensor) -> Tensor:
    """This process's share of `value`, of which every process has all, shared out as `parameter` is."""
    if not _is_shared(parameter):
        return value
    from torch.distributed.tensor import distribute_tensor  # noqa: PLC0415

    return distribute_tensor(value, parameter.device_mesh, parameter.placements, src_data_rank=None).to_local()


@contextmanager
def gathered(module: nn.Module) -> Iterator[None]:
    """With all of a module's weights at hand, for a pass that is not its own `forward`."""
    if not _is_sharded(module):
        yield
        return
    module.unshard()
    try:
        yield
    finally:
        module.reshard()


@torch.no_grad()
def fill(model: nn.Module, sharded: nn.Module) -> None:
    """Copies all weights of a sharded model into a plain one of the same kind."""
    weights = dict(sharded.named_parameters())
    for name, parameter in model.named_parameters():
        parameter.copy_(full(weights[name]))


def _is_shared(tensor: Tensor) -> TypeGuard[DTensor]:
    return hasattr(tensor, "placements")


def _is_sharded(module: nn.Module) -> TypeGuard[FSDPModule]:
    return hasattr(module, "unshard")
