"""Checkpoints: whole folders, written under a temporary name and renamed, and read back without pickle.

A run's folder holds `last` and `best`, each in the Hugging Face layout (`config.json`, `model.safetensors`, the
tokenizer's files, `run.toml`, `README.md`). `last` also has what a resumed run needs: `optimizer.safetensors` and
`trainer.json`. A write that fails leaves the earlier checkpoint as it was.
"""

from __future__ import annotations

import json
import shutil
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

from safetensors import SafetensorError
from safetensors.torch import load_file, save_file

from strips_lm._native import DataError
from strips_lm.sharding import share, whole

if TYPE_CHECKING:
    from pathlib import Path

    import torch
    from torch.optim import Optimizer
    from transformers import PreTrainedModel

    from strips_lm.config import RunConfig
    from strips_lm.tokenizer import PlanTokenizer

OPTIMIZER, TRAINER = "optimizer.safetensors", "trainer.json"


class CheckpointError(DataError):
    """A checkpoint that cannot be written or resumed."""


@dataclass(slots=True)
class Progress:
    """Where a run stands; every random choice of a step follows from the seed and the step's number."""

    step: int = 0
    """Optimisation steps done."""
    drawn: int = 0
    """Steps' worth of records drawn for them: more where records are selected."""
    seconds: float = 0.0
    """Time trained."""
    tokens: int = 0
    """Tokens seen, without padding."""
    best: float | None = None
    """Lowest validation loss so far, both heads weighted as in training."""
    measured: int = 0
    """Measurements on the validation split so far."""


@dataclass(frozen=True, slots=True)
class Keeper:
    """Writes the checkpoints of one run."""

    out: Path
    config: RunConfig
    tokenizer: PlanTokenizer
    about: dict[str, Any]
    """What the model card says of the data."""

    def save_best(self, model: PreTrainedModel, progress: Progress) -> None:
        """Writes `best`: weights alone."""
        self._write("best", model, progress, None)

    def save_last(self, model: PreTrainedModel, progress: Progress, state: dict[str, torch.Tensor]) -> None:
        """Writes `last`: weights and what a resumed run needs, `state` being the optimiser's `flatten`."""
        self._write("last", model, progress, state)

    def _write(
        self, name: str, model: PreTrainedModel, progress: Progress, state: dict[str, torch.Tensor] | None
    ) -> None:
        partial = self.out / f".{name}.partial"
        shutil.rmtree(partial, ignore_errors=True)
        try:
            partial.mkdir(parents=True)
            self._fill(partial, model, progress, state)
        except (OSError, SafetensorError) as error:
            shutil.rmtree(partial, ignore_errors=True)
            raise CheckpointError(_not_written(self.out / name, error)) from error
        _swap(partial, self.out / name)

    def _fill(
        self, folder: Path, model: PreTrainedModel, progress: Progress, state: dict[str, torch.Tensor] | None
    ) -> None:
        model.save_pretrained(folder)
        self.tokenizer.save_pretrained(folder)
        self.config.save(folder / "run.toml")
        (folder / "README.md").write_text(model_card(self.config, progress, self.about), encoding="utf-8")
        if state is not None:
            save_file(state, folder / OPTIMIZER)
            (folder / TRAINER).write_text(json.dumps(asdict(progress)) + "\n", encoding="utf-8")


def _not_written(folder: Path, error: Exception) -> str:
    kept = "the earlier one is as it was" if folder.exists() else "there is no earlier one"
    return f"{folder}: checkpoint not written: {error}; {kept}\nhint: make room, then go on with `--resume`"


def _swap(new: Path, final: Path) -> None:
    """Puts a finished folder in its place; between the two renames the earlier one is found as `NAME.old`."""
    old = final.with_name(f"{final.name}.old")
    if final.exists():
        shutil.rmtree(old, ignore_errors=True)
        final.rename(old)
    new.rename(final)
    shutil.rmtree(old, ignore_errors=True)


def last_checkpoint(out: Path) -> Path:
    """The folder of the checkpoint that a resumed run goes on from.

    Raises:
        CheckpointError: there is none.
    """
    folder = next((f for f in (out / "last", out / "last.old") if (f / TRAINER).is_file()), None)
    if folder is None:
        raise CheckpointError(f"{out}: nothing to resume\nhint: train without `--resume` first")
    return folder


def resume(folder: Path, model: PreTrainedModel, optimizer: Optimizer) -> Progress:
    """Puts weights and optimiser back as a checkpoint has them and returns where the run stood.

    Raises:
        CheckpointError: it is of another model.
    """
    weights = load_file(folder / "model.safetensors")
    missing = set(model.state_dict()) - set(weights) - {"lm_head.weight"}
    if missing:
        raise CheckpointError(f"{folder}: of another model: it lacks {min(missing)}")
    model.load_state_dict(weights, strict=False)
    model.tie_weights()
    unflatten(load_file(folder / OPTIMIZER), optimizer)
    stood = json.loads((folder / TRAINER).read_text(encoding="utf-8"))
    return Progress(**{"drawn": stood["step"], **stood})


def flatten(optimizer: Optimizer) -> dict[str, torch.Tensor]:
    """The optimiser's tensors, whole, named by the parameter's number and their own name."""
    flat = {}
    for number, parameter in enumerate(_parameters(optimizer)):
        for name, value in optimizer.state.get(parameter, {}).items():
            full = whole(value, parameter) if value.ndim else value
            flat[f"{number}.{name}"] = full.detach().clone().contiguous()
    return flat


def unflatten(flat: dict[str, torch.Tensor], optimizer: Optimizer) -> None:
    """Puts back what `flatten` gave, into an optimiser of the same parameters, however they are shared out."""
    parameters = _parameters(optimizer)
    for key, value in flat.items():
        number, _, name = key.partition(".")
        parameter = parameters[int(number)]
        optimizer.state[parameter][name] = share(value.to(parameter.device), parameter) if value.ndim else value


def _parameters(optimizer: Optimizer) -> list[torch.Tensor]:
    return [parameter for group in optimizer.param_groups for parameter in group["params"]]


def model_card(config: RunConfig, progress: Progress, about: dict[str, Any]) -> str:
    """The README of a checkpoint: what it is, what it was trained on, how far it got, what it is not for."""
    loss = "not measured" if progress.best is None else f"{progress.best:.4f}"
    lines = "\n".join(f"| {key} | {value} |" for key, value in about.items())
    return f"""---
library_name: transformers
tags: [planning, strips, pddl, strips-lm]
---
# A STRIPS planner: {config.model.kind}, {config.model.layers} layers, {config.model.width} wide

Writes plans (actions and the states between them) for problems of its domains. Trained by strips-lm on text made by its
oracle; `run.toml` has every setting, `strips-lm generate` runs it and checks the plan.

| | |
|---|---|
| tokenizer | {config.tokenizer.kind} |
| steps | {progress.step} |
| tokens seen | {progress.tokens} |
| seconds trained | {progress.seconds:.0f} |
| best validation loss | {loss} |
{lines}

## Limits

It knows the actions of its domains alone. A plan that it writes may be wrong: check it with `strips-lm validate`.
"""
