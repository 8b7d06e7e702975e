"""What the processor has: cores for this process, and instructions for number types."""

from __future__ import annotations

import os
import platform
from functools import cache

import torch


@cache
def multiplies_bfloat16(device: torch.device) -> bool:
    """Whether a device multiplies bfloat16 quicker than float32, as far as can be told without a trial.

    oneDNN's own answer is yes for every x86 processor with AVX-512, where it emulates such products at less than half
    the speed of float32 (docs/experiments.md); so there the instructions themselves are asked for. Those within AVX-512
    were found twice as fast as float32 on one make without AMX, and half as fast on Intel's where a virtual machine
    hides AMX.
    """
    if device.type != "cpu":
        return device.type == "cuda"
    if platform.machine().lower() in {"x86_64", "amd64"}:
        return _has_amx() or (bool(torch.cpu._is_avx512_bf16_supported()) and not _is_intel())  # noqa: SLF001
    return bool(torch.ops.mkldnn._is_mkldnn_bf16_supported())  # noqa: SLF001  (torch has no public name)


def _has_amx() -> bool:
    return bool(torch.cpu._is_amx_tile_supported())  # noqa: SLF001


def _is_intel() -> bool:
    """Windows says so in the processor's name, Linux in the list of processors."""
    return "GenuineIntel" in (_listed("vendor_id") or platform.processor())


def usable_cores() -> int:
    """Cores that this process may run on, at least 1; where the system does not tell, all that there are."""
    affinity = getattr(os, "sched_getaffinity", None)  # Linux alone has it before Python 3.13
    return max(1, len(affinity(0)) if affinity else os.cpu_count() or 1)


@cache
def processor_name() -> str:
    """What the processor is called, as far as the system says; with the vector instructions that PyTorch uses.

    Virtual machines that have AMX and those from which it is hidden may be called alike.
    """
    name = _listed("model name") or platform.processor() or platform.machine()  # Linux says `x86_64` of its own
    return f"{name} {torch.backends.cpu.get_cpu_capability()}{' AMX' if _has_amx() else ''}"


def _listed(about: str) -> str:
    """What Linux's list of processors says of the first one; empty where there is no such list, or it does not say."""
    if not os.path.exists("/proc/cpuinfo"):  # noqa: PTH110
        return ""
    with open("/proc/cpuinfo", encoding="utf-8", errors="replace") as file:  # noqa: PTH123
        found = [line.partition(":")[2].strip() for line in file if line.startswith(about)]
    return found[0] if found else ""
