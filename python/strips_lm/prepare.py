"""What a training run holds in its hands, and how it comes by it: data, model, optimiser, devices."""

from __future__ import annotations

import copy
import os
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import torch
from accelerate import Accelerator
from accelerate.tracking import get_available_trackers
from accelerate.utils import DistributedType, broadcast_object_list

from strips_lm import tokenizer as tokenizers
from strips_lm._native import Domain
from strips_lm.checkpoint import Keeper, Progress, flatten, last_checkpoint, resume, unflatten
from strips_lm.dataset import DataSetError, entropy_floor, open_data, texts
from strips_lm.folders import data_sets
from strips_lm.goal_targets import GoalReader
from strips_lm.model import ModelError, make_model
from strips_lm.muon import make_optimizer
from strips_lm.objective import Objective, validation_step
from strips_lm.own_steps import FILE
from strips_lm.second_head import check_own_steps, draws_own_steps
from strips_lm.sharding import fill, shard
from strips_lm.tuning import default, load_choice, save_choice, tuned
from strips_lm.watch import Clock, say

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from torch.optim import Optimizer
    from transformers import PreTrainedModel

    from strips_lm.batches import Step
    from strips_lm.config import RunConfig, TrainConfig
    from strips_lm.dataset import PlanDataset
    from strips_lm.tokenizer import PlanTokenizer
    from strips_lm.tuning import Choice, Tell


@dataclass(slots=True)
class Run:
    """Everything that one training run holds in its hands."""

    config: RunConfig
    folder: Path
    """The data set's, or a mixture's."""
    data: PlanDataset
    held: PlanDataset
    """The validation split."""
    accelerator: Accelerator
    objective: torch.nn.Module
    optimizer: Optimizer
    validation: Step
    floor: float | None
    keeper: Keeper
    progress: Progress
    clock: Clock
    twin: PreTrainedModel | None = None
    """A plain model for what is written, where processes share the weights out."""

    def whole_model(self) -> PreTrainedModel:
        """The model itself with all of its weights, out of its wrappers; every process asks for it, or none does."""
        model: PreTrainedModel = self.accelerator.unwrap_model(self.objective).model
        if self.twin is None:
            return model
        fill(self.twin, model)
        return self.twin


def prepare(config: RunConfig, data: Path, out: Path, resumed: bool, shown: bool) -> Run:
    """Opens the data, makes or resumes the model, and writes `run.toml`."""
    for folder in data_sets(data):
        if not (folder / "data").is_dir():
            raise DataSetError(f"{folder}: no data set here\nhint: strips-lm gen-data --out {folder}")
    check_own_steps(config, data)
    if os.environ.pop("ACCELERATE_USE_FSDP", "").lower() == "true":  # `accelerate launch --use_fsdp`
        config = replace(config, train=replace(config.train, shard=True))
    accelerator = _accelerator(config.train.trackers, out)
    out.mkdir(parents=True, exist_ok=True)
    if not resumed and accelerator.is_main_process:
        (out / FILE).unlink(missing_ok=True)
    tokenizer = _tokenizer(config, data, out, resumed)
    with accelerator.main_process_first():
        training, validation = _open(config, data, tokenizer)
    model = make_model(config.model, tokenizer, config.seed).to(accelerator.device)
    model.config.judges_steps = draws_own_steps(config)
    optimizer = make_optimizer(model, config.train)
    progress = resume(last_checkpoint(out), model, optimizer) if resumed else Progress()
    objective = Objective(model, torch.float32).train()
    tell = say if shown and accelerator.is_main_process else lambda _: None
    choice = load_choice(out) if resumed else None
    choice = choice or _choose(config, objective, training, accelerator, tell)
    choice.apply(objective)
    sharded = config.train.shard and accelerator.num_processes > 1
    twin = copy.deepcopy(model).cpu() if sharded else None
    if sharded:
        optimizer = accelerator.prepare(_sharded(objective, optimizer, config.train, accelerator.device))
    else:
        objective, optimizer = accelerator.prepare(objective, optimizer)
    config.save(out / "run.toml")
    save_choice(out, choice)
    about = {"domains": _domains(data), "records": len(training), "records too long, left out": training.left_out}
    records = min(config.train.validation_records, len(validation))
    choices = config.model.kind == "double-head" and not draws_own_steps(config)
    held = validation_step(validation, records, config.train.batch_tokens, choices)
    return Run(
        config,
        data,
        training,
        validation,
        accelerator,
        objective,
        optimizer,
        held,
        entropy_floor(validation, records),
        Keeper(out, config, tokenizer, about),
        progress,
        Clock(progress.seconds),
        twin,
    )


def _sharded(objective: Objective, optimizer: Optimizer, train: TrainConfig, device: torch.device) -> Optimizer:
    """Shares the model out among the processes, and gives its optimiser, which goes on where `optimizer` stood."""
    state = flatten(optimizer)
    shard(objective, device)
    shared = make_optimizer(objective.model, train)
    unflatten(state, shared)
    return shared


def _choose(config: RunConfig, objective: Objective, data: PlanDataset, accelerator: Accelerator, tell: Tell) -> Choice:
    """How the layers run: as a trial finds where one is asked for, else as the configuration says; alike everywhere."""
    train, device = config.train, accelerator.device
    tried = train.autotune is True or (train.autotune == "auto" and not train.steps)
    agreed = [tuned(config, objective, data, device, tell) if tried else default(train, objective.model, device)]
    if accelerator.num_processes > 1:
        broadcast_object_list(agreed)
    return agreed[0]


def _domains(data: Path) -> str:
    """The names of the domains that the data is of, as far as the folders say."""
    paths = [path for path in (folder / "domain.pddl" for folder in data_sets(data)) if path.is_file()]
    return ", ".join(Domain.parse(path.read_bytes(), str(path)).name for path in paths) or "?"


def _accelerator(trackers: Sequence[str], out: Path) -> Accelerator:
    """Devices and trackers as the launcher and the configuration have them."""
    missing = [name for name in trackers if name not in {str(kind.value) for kind in get_available_trackers()}]
    if missing:
        raise ModelError(f"no tracker `{missing[0]}` here\nhint: pip install 'strips-lm[trackers]'")
    # Several processes without a GPU train on CPUs; untold, each would train a model of its own.
    cpus = int(os.environ.get("WORLD_SIZE", "1")) > 1 and not torch.cuda.is_available()
    accelerator = Accelerator(cpu=cpus, log_with=list(trackers) or None, project_dir=str(out))
    if accelerator.distributed_type not in {DistributedType.NO, DistributedType.MULTI_CPU, DistributedType.MULTI_GPU}:
        kind = accelerator.distributed_type.value
        raise ModelError(f"{kind} is not supported\nhint: launch data-parallel or FSDP training")
    return accelerator


def _tokenizer(config: RunConfig, data: Path, out: Path, resumed: bool) -> PlanTokenizer:
    """A resumed run's own tokenizer, or a new one."""
    return tokenizers.load(last_checkpoint(out)) if resumed else tokenizers.make(config.tokenizer, data, texts(data))


def _open(config: RunConfig, data: Path, tokenizer: PlanTokenizer) -> tuple[PlanDataset, PlanDataset]:
    """The training and the validation split."""
    context, room, train = config.model.context, config.train.position_offset, config.train

    def opened(stored: PlanTokenizer) -> PlanDataset:
        return open_data(data, "train", stored, context, room)

    held = open_data(data, "validation", tokenizer, context)
    spelling = tokenizer.spelling(context - room) if train.drawn_names else None
    if spelling is None:
        reader = GoalReader.of(tokenizer) if train.goal_weight and config.model.kind != "lstm" else None
        return replace(opened(tokenizer), goal_reader=reader), held
    named = opened(tokenizer) if train.drawn_names < 1.0 else None
    return replace(opened(tokenizer.slotted), spelling=spelling, named=named), held
