"""What two processes hold of a model that is shared out, and that nothing is lost on the way."""

import os
import socket
import subprocess
import sys

import pytest

PROGRAM = """
import copy
import time
import torch
from torch import distributed, nn
from torch.distributed.fsdp import FSDPModule
from strips_lm.sharding import fill, full, gathered, local, shard, share, whole

distributed.init_process_group("gloo")
torch.manual_seed(0)
model = nn.Sequential(nn.Linear(6, 5), nn.LayerNorm(5), nn.Linear(5, 1))
plain = copy.deepcopy(model)
shard(model, torch.device("cpu"))
assert isinstance(model, FSDPModule)
held = sum(local(parameter).numel() for parameter in model.parameters())
assert 0 < held < sum(parameter.numel() for parameter in plain.parameters()), held
for name, parameter in model.named_parameters():
    given = dict(plain.named_parameters())[name]
    assert torch.equal(whole(local(parameter), parameter), given), name
    assert torch.equal(share(given.detach(), parameter), local(parameter)), name
    assert torch.equal(full(parameter), given), name
with gathered(model):
    assert torch.equal(model[0].weight, plain[0].weight)
twin = copy.deepcopy(plain)
for parameter in twin.parameters():
    parameter.data.zero_()
fill(twin, model)
assert all(torch.equal(a, b) for a, b in zip(twin.parameters(), plain.parameters(), strict=True))

# A mean over both processes' rows, as one process has it over all.
rows = torch.randn(4, 6)
model(rows[distributed.get_rank() :: 2]).mean().backward()
plain(rows).mean().backward()
for one, two in zip(model.parameters(), plain.parameters(), strict=True):
    torch.testing.assert_close(full(one.grad), two.grad)
for tensor in plain.parameters():
    assert local(tensor) is whole(tensor, tensor) is share(tensor, tensor) is full(tensor) is tensor
with gathered(plain):
    pass
distributed.barrier()
time.sleep(0.1)  # see `train._part`
distributed.destroy_process_group()
"""


@pytest.mark.slow
def test_shares_are_parts_of_a_whole():
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    env = {**os.environ, "OMP_NUM_THREADS": "1", "MASTER_ADDR": "127.0.0.1", "MASTER_PORT": str(port)}
    processes = [
        subprocess.Popen(
            [sys.executable, "-c", PROGRAM],
            env={**env, "WORLD_SIZE": "2", "RANK": str(rank), "LOCAL_RANK": str(rank)},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        for rank in range(2)
    ]
    texts = [process.communicate(timeout=300)[0] for process in processes]
    assert [process.returncode for process in processes] == [0, 0], "\n".join(texts)
