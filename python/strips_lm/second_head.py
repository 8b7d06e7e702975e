"""The second head that judges the model's own steps: they are drawn, judged by the oracle, and shown from then on.

The model that is being trained draws them itself, once, where `train.mc_start` is reached: what it gets wrong then is
what the head has to find. The first process draws and writes the file, all read it. A resumed run finds it there, or
draws the same again.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

from strips_lm.config import ConfigError, GenerateConfig
from strips_lm.dataset import speaking
from strips_lm.evaluate.suites import DataFolder
from strips_lm.folders import data_sets
from strips_lm.generate import Planner
from strips_lm.objective import validation_step
from strips_lm.own_steps import FILE, read, write
from strips_lm.sample_steps import sample_steps

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from strips_lm.config import RunConfig
    from strips_lm.own_steps import OwnStep
    from strips_lm.prepare import Run

AT_ONCE = 500
"""Prompts whose steps are drawn at once."""

SHARE = 1 / 15
"""Share of a run's minutes after which no more are drawn."""


def draws_own_steps(config: RunConfig) -> bool:
    """Whether a run's second head judges steps."""
    return config.model.kind == "double-head" and config.train.own_steps > 0


def check_own_steps(config: RunConfig, data: Path) -> None:
    """Whether steps can be drawn for the data, where a run is to.

    Raises:
        ConfigError: it is a mixture, or not a finished data set; or they would be those of an untrained model.
    """
    if not draws_own_steps(config):
        return
    if config.train.mc_start == 0.0 and not config.model.initial:
        raise ConfigError(
            "`train.own_steps` would be drawn from an untrained model\n"
            "hint: `--set model.initial=RUN/last`, or raise `train.mc_start`"
        )
    if len(data_sets(data)) > 1:
        raise ConfigError("`train.own_steps` goes with one data set, not with a mixture of several")
    DataFolder(data)


class _StoppedError(Exception):
    """The run is to end before all steps are drawn."""


def _go_on(stopped: Callable[[], bool], _done: int) -> None:
    if stopped():
        raise _StoppedError


def _draw(run: Run, planner: Planner, folder: DataFolder, tick: Callable[[int], None]) -> list[OwnStep]:
    """Steps for `train.own_steps` prompts, or for as many as a run that is measured in minutes has time for."""
    train, start, found = run.config.train, run.clock.seconds(), []
    items = folder.items("train", train.own_steps)
    for first in range(0, len(items), AT_ONCE):
        planner.seed = run.config.seed + first
        found += sample_steps(planner, folder, items[first : first + AT_ONCE], tick)
        if not train.steps and run.clock.seconds() - start > SHARE * 60.0 * train.minutes:
            break
    return found


def show_own_steps(run: Run, stopped: Callable[[], bool] = lambda: False) -> str:
    """Has the run's second head shown the model's own steps, drawn now unless they were; says how many there are.

    Where `stopped` says so while they are drawn, all is left as it was.
    """
    path, tokenizer, train = run.keeper.out / FILE, run.keeper.tokenizer, run.config.train
    folder = DataFolder(run.folder)
    model = run.whole_model()
    if run.accelerator.is_main_process and not path.is_file():
        training = model.training
        model.train(False)
        planner = Planner(model, tokenizer, GenerateConfig(), run.config.seed).for_domain(folder.domain)
        with suppress(_StoppedError):
            write(path, _draw(run, planner, folder, partial(_go_on, stopped)))
        model.train(training)
    run.accelerator.wait_for_everyone()
    if not path.is_file():
        return "own steps: not drawn"
    stored = tokenizer if run.data.spelling is None else tokenizer.slotted
    context = run.config.model.context
    shown = read(path, speaking(stored, folder.path), context - train.position_offset)[0]
    held = read(path, speaking(tokenizer, folder.path), context)[1]
    run.data = replace(run.data, own_steps=shown)
    measured = replace(run.held, own_steps=held)
    run.validation = validation_step(measured, train.validation_records, train.batch_tokens, bool(held))
    return f"own steps: {len(shown.right) + len(held.right)} right, {len(shown.wrong) + len(held.wrong)} wrong"
