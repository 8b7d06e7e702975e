"""What the processor has: cores for this process, and instructions for number types."""

from __future__ import annotations

import os
import platform
from functools import cache

import torch


@cache
def multiplies_bfloat16(device: torch.device) -> bool:
    """Whether a device has instructions for bfloat16 products.

    oneDNN's own answer is yes for every x86 processor with AVX-512, where it emulates them at less than half the speed
    of float32 (docs/experiments.md); so there the instructions themselves are asked for.
    """
    if device.type != "cpu":
        return device.type == "cuda"
    if platform.machine().lower() in {"x86_64", "amd64"}:
        return bool(torch.cpu._is_avx512_bf16_supported() or torch.cpu._is_amx_tile_supported())  # noqa: SLF001
    return bool(torch.ops.mkldnn._is_mkldnn_bf16_supported())  # noqa: SLF001  (torch has no public name)


def usable_cores() -> int:
    """Cores that this process may run on, at least 1; where the system does not tell, all that there are."""
    affinity = getattr(os, "sched_getaffinity", None)  # Linux alone has it before Python 3.13
    return max(1, len(affinity(0)) if affinity else os.cpu_count() or 1)


@cache
def processor_name() -> str:
    """What the processor is called, as far as the system says; with the vector instructions that PyTorch uses."""
    name = platform.processor() or platform.machine()
    if os.path.exists("/proc/cpuinfo"):  # noqa: PTH110  (Linux says `x86_64` otherwise)
        with open("/proc/cpuinfo", encoding="utf-8", errors="replace") as file:  # noqa: PTH123
            found = [line.partition(":")[2].strip() for line in file if line.startswith("model name")]
        name = found[0] if found else name
    return f"{name} {torch.backends.cpu.get_cpu_capability()}"
