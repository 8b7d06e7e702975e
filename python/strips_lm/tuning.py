"""How a run's layers run: number type, compiled or not, threads; chosen by a short measured trial and remembered.

A trial is forward and backward passes over a few of the run's own records, so it costs a second or two, and compiling a
minute once. Types and compilation depend on the machine, the libraries and the model's shape alone: what was measured
is kept in the user's cache folder and used by the next run of the kind. The number of threads is tried each time, as it
depends on what else the machine is doing: OpenMP's barriers wait for the slowest thread, and on a machine whose cores
are busy two threads were found ten times slower than one (docs/experiments.md).

A run keeps its choice in `tuning.json`, and a resumed run has it from there: sums depend on all three.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
import platform
import shutil
import sys
import time
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

import torch

from strips_lm.batches import Dress, Plan, build_step
from strips_lm.lstm import LstmLMHeadModel
from strips_lm.model import ModelError
from strips_lm.processor import multiplies_bfloat16, processor_name, usable_cores

if TYPE_CHECKING:
    from collections.abc import Callable

    from transformers import PreTrainedModel

    from strips_lm.batches import Batch
    from strips_lm.config import RunConfig, TrainConfig
    from strips_lm.dataset import PlanDataset
    from strips_lm.objective import Objective

    Tell = Callable[[str], None]

FILE = "tuning.json"
"""Where a run keeps its choice."""

CPU_TOKENS = 2048
"""Most tokens of a pass on a CPU: enough for the matrix products to count, few enough for a fraction of a second."""

HOPED_GAIN, COMPILE_SECONDS = 0.1, 60.0
"""What compiling is hoped to save and expected to cost: it is tried where the run is long enough for that to pay."""


@dataclass(frozen=True, slots=True)
class Choice:
    """How the layers of a run run."""

    precision: str
    """`float32` or `bfloat16`."""
    compiled: bool = False
    """Whether `torch.compile` has made the layers' dense parts."""
    threads: int = 0
    """PyTorch's threads on a CPU; 0 leaves them as they are."""

    @property
    def dtype(self) -> torch.dtype:
        """`precision` as PyTorch has it."""
        found: torch.dtype = getattr(torch, self.precision)
        return found

    def apply(self, objective: Objective) -> None:
        """Has the objective, and this process, run so."""
        objective.dtype = self.dtype
        objective.compiled = self.compiled
        if self.threads:
            torch.set_num_threads(self.threads)


@dataclass(slots=True)
class Trial:
    """What was measured: seconds a pass, or none where it was not tried."""

    float32: float | None = None
    bfloat16: float | None = None
    compiled: float | None = None
    """In the faster type."""
    compile_seconds: float | None = None
    """What compiling took; none and no `compiled` where it was not tried."""
    cannot_compile: str = ""
    """Why it cannot be compiled here."""


def default(train: TrainConfig, model: PreTrainedModel, device: torch.device) -> Choice:
    """Without a trial: bfloat16 on request or where the processor multiplies it quicker, compiled only on request.

    Raises:
        ModelError: layers are to be compiled, and there is no compiler.
    """
    lstm = isinstance(model, LstmLMHeadModel)
    missing = _missing_compiler(device) if train.compile == "always" else ""
    if missing:
        raise ModelError(f"`train.compile = always`: {missing}")
    wanted = "bfloat16" if multiplies_bfloat16(device) else "float32"
    precision = "float32" if lstm else wanted if train.precision == "auto" else train.precision
    return Choice(precision, train.compile == "always" and not lstm)


def tuned(
    config: RunConfig, objective: Objective, data: PlanDataset, device: torch.device, tell: Tell = lambda _: None
) -> Choice:
    """The fastest choice of those that the configuration leaves open; what was measured is told and remembered."""
    choice = default(config.train, objective.model, device)
    batch = _batch(config, data, device)
    if device.type == "cpu":
        choice = replace(choice, threads=_threads(objective, choice, batch, tell))
    if isinstance(objective.model, LstmLMHeadModel):
        return choice
    path = cache_folder() / f"{_key(config, objective, device, choice.threads)}.json"
    found = _recall(path)
    known = Trial() if found is None else replace(found)
    choice = _try_types(config.train, objective, choice, batch, known)
    choice = _try_compiling(config, objective, choice, batch, known)
    if known != found:
        _remember(path, known)
    tell(_said(choice, known, remembered=known == found))
    return choice


def _threads(objective: Objective, choice: Choice, batch: Batch, tell: Tell) -> int:
    """One thread or as many as there are, whichever trains faster now."""
    most = torch.get_num_threads()
    if most == 1:
        return 1
    times = {number: _seconds(objective, replace(choice, threads=number), batch) for number in (1, most)}
    torch.set_num_threads(most)
    tell("threads: " + ", ".join(f"{number}: {seconds:.3f} s a pass" for number, seconds in times.items()))
    return min(times, key=lambda number: times[number])


def _try_types(train: TrainConfig, objective: Objective, choice: Choice, batch: Batch, known: Trial) -> Choice:
    """The faster of float32 and bfloat16, unless the configuration says which."""
    if train.precision != "auto":
        return choice
    if known.float32 is None or known.bfloat16 is None:
        eager = replace(choice, compiled=False)
        known.float32 = _seconds(objective, replace(eager, precision="float32"), batch)
        known.bfloat16 = _seconds(objective, replace(eager, precision="bfloat16"), batch)
    return replace(choice, precision="bfloat16" if known.bfloat16 < known.float32 else "float32")


def _try_compiling(config: RunConfig, objective: Objective, choice: Choice, batch: Batch, known: Trial) -> Choice:
    """Compiled, where that pays for itself within the run."""
    if config.train.compile != "auto" or known.cannot_compile:
        return choice
    eager = known.bfloat16 if choice.precision == "bfloat16" else known.float32
    if eager is None:
        eager = _seconds(objective, choice, batch)
        setattr(known, choice.precision, eager)
    budget = _budget(config.train, eager, batch)
    if known.compiled is None:
        if budget * HOPED_GAIN < COMPILE_SECONDS:
            return choice
        _measure_compiled(objective, choice, batch, known)
    return replace(choice, compiled=pays(budget, eager, known))


def pays(budget: float, eager: float, known: Trial) -> bool:
    """Whether compiling saves more of a budget of seconds than it takes."""
    if known.compiled is None or known.compile_seconds is None:
        return False
    return budget * (1.0 - known.compiled / eager) > known.compile_seconds


def _measure_compiled(objective: Objective, choice: Choice, batch: Batch, known: Trial) -> None:
    """Fills in what compiling takes and gives, or why it cannot be had."""
    known.cannot_compile = _missing_compiler(batch.input_ids.device)
    if known.cannot_compile:
        return
    start = time.monotonic()
    try:
        seconds = _seconds(objective, replace(choice, compiled=True), batch)
    except Exception as error:  # compilers fail in ways of their own, and a run can do without
        known.cannot_compile = str(error).strip().splitlines()[0][:200] if str(error).strip() else repr(error)
        objective.zero_grad()
        return
    known.compiled = seconds
    known.compile_seconds = max(time.monotonic() - start - PASSES * seconds, 0.0)


def _missing_compiler(device: torch.device) -> str:
    """What `torch.compile` lacks on this machine; nothing where it may work."""
    if device.type == "cuda":
        return "" if find_spec("triton") else "triton is not installed"
    names = [os.environ.get("CXX", ""), "g++", "clang++", "c++", "cl"]
    return "" if any(name and shutil.which(name) for name in names) else "there is no C++ compiler"


PASSES = 3
"""Forward and backward passes of a measurement; the first one warms up."""


def _seconds(objective: Objective, choice: Choice, batch: Batch) -> float:
    """The faster of two passes, after one that warms up."""
    choice.apply(objective)
    times = []
    for _ in range(PASSES):
        start = time.monotonic()
        objective(batch).lm.backward()
        if batch.input_ids.is_cuda:
            torch.cuda.synchronize()
        times.append(time.monotonic() - start)
    objective.zero_grad()
    return min(times[1:])


def _batch(config: RunConfig, data: PlanDataset, device: torch.device) -> Batch:
    """A batch of the run's own records, as the loop builds them, of at most `CPU_TOKENS` on a CPU."""
    train, ragged = config.train, device.type == "cpu" and config.model.kind != "lstm"
    tokens = min(train.batch_tokens, CPU_TOKENS) if device.type == "cpu" else train.batch_tokens
    plan = Plan(step_tokens=1, step_pairs=0, batch_tokens=tokens, spread=0.1 if ragged else math.inf)
    rows = int(max(1, tokens // max(1, int(data.lengths[data.kept[:256]].mean()))))
    return build_step(data, data.kept[:rows], plan, Dress(), (0,)).batches[0].to(device)


def _budget(train: TrainConfig, seconds: float, batch: Batch) -> float:
    """Seconds that the run will train, the earlier of its two ends."""
    by_clock = 60.0 * train.minutes or math.inf
    by_steps = train.steps * seconds * train.step_tokens / batch.input_ids.numel() or math.inf
    return min(by_clock, by_steps)


def cache_folder() -> Path:
    """Where measurements are kept: the user's cache folder, as the system has it."""
    home = Path.home()
    if sys.platform == "win32":
        base = Path(os.environ.get("LOCALAPPDATA") or home / "AppData" / "Local")
    elif sys.platform == "darwin":
        base = home / "Library" / "Caches"
    else:
        base = Path(os.environ.get("XDG_CACHE_HOME") or home / ".cache")
    return base / "strips-lm" / "tuning"


def _key(config: RunConfig, objective: Objective, device: torch.device, threads: int) -> str:
    """A hash of all that the measurements depend on."""
    about = {
        "version": 1,
        "torch": torch.__version__,
        "system": [platform.system(), platform.machine(), platform.python_version()],
        "device": torch.cuda.get_device_name(device) if device.type == "cuda" else [processor_name(), usable_cores()],
        "threads": threads,
        "model": asdict(config.model),
        "vocabulary": objective.model.config.vocab_size,
        "batch_tokens": config.train.batch_tokens,
    }
    return hashlib.sha256(json.dumps(about, sort_keys=True).encode()).hexdigest()[:24]


def _recall(path: Path) -> Trial | None:
    """An earlier trial's measurements; none where there are no readable ones."""
    with suppress(OSError, ValueError, TypeError):
        return Trial(**json.loads(path.read_text(encoding="utf-8")))
    return None


def _remember(path: Path, known: Trial) -> None:
    """Keeps the measurements, where the folder can be written."""
    partial = path.with_name(f".{path.name}.{os.getpid()}")
    with suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        partial.write_text(json.dumps(asdict(known)) + "\n", encoding="utf-8")
        partial.replace(path)


def _said(choice: Choice, known: Trial, *, remembered: bool) -> str:
    """The choice and what it rests on, in a line."""
    names = {"float32": known.float32, "bfloat16": known.bfloat16, "compiled": known.compiled}
    parts = [f"{name} {seconds:.3f} s a pass" for name, seconds in names.items() if seconds is not None]
    if known.compile_seconds is not None:
        parts.append(f"compiling took {known.compile_seconds:.0f} s")
    if known.cannot_compile:
        parts.append(f"not compiled: {known.cannot_compile}")
    threads = f", {choice.threads} thread{'s' * (choice.threads > 1)}" if choice.threads else ""
    how = f"autotune: {choice.precision}, {'compiled' if choice.compiled else 'not compiled'}{threads}"
    return f"{how} ({', '.join(parts)}{'; measured by an earlier run' if remembered else ''})" if parts else how


def load_choice(out: Path) -> Choice | None:
    """The choice that a run keeps; none where it has none."""
    path = out / FILE
    return Choice(**json.loads(path.read_text(encoding="utf-8"))) if path.is_file() else None


def save_choice(out: Path, choice: Choice) -> None:
    """Keeps a run's choice in its folder."""
    (out / FILE).write_text(json.dumps(asdict(choice)) + "\n", encoding="utf-8")
