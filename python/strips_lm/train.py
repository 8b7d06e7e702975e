"""The training loop: one function that can be read aloud, on `accelerate`.

Every random choice of a step is a function of (seed, step), so that a resumed run needs nothing but weights,
optimiser and `Progress`. With a budget in steps it ends bit for bit where an uninterrupted run does (on a CPU); with
one in minutes the clock decides. A step's loss is a mean over the whole step, whatever it is cut into.
"""

from __future__ import annotations

import math
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import torch
from accelerate.utils import broadcast_object_list

from strips_lm.batches import Dress, Plan, build_step, walk
from strips_lm.checkpoint import flatten
from strips_lm.forward import Layout, best_layout
from strips_lm.loss import weighted
from strips_lm.objective import measure
from strips_lm.prepare import Run, prepare
from strips_lm.second_head import draws_own_steps, show_own_steps
from strips_lm.selection import Selection
from strips_lm.sharding import full
from strips_lm.watch import Signals, Watch

if TYPE_CHECKING:
    from concurrent.futures import Future

    from numpy.typing import NDArray
    from transformers import PreTrainedModel

    from strips_lm.batches import Step
    from strips_lm.config import RunConfig, TrainConfig

LOG_EVERY = 10
"""Steps between two lines of `metrics.jsonl`."""


class NotFiniteError(ArithmeticError):
    """A loss that is no number; the message names the step's records."""


def train(config: RunConfig, data: str | Path, out: str | Path, *, resumed: bool = False, shown: bool = True) -> int:
    """Trains a model on a data set and leaves `best`, `last`, `metrics.jsonl` and `run.toml` in `out`.

    Returns 0, or the number of the signal that ended the run early (its checkpoint is written).

    Raises:
        DataSetError, TokenizerError, ModelError, CheckpointError: what was given cannot be trained or resumed.
        NotFiniteError: the loss is no longer a number; `last` is of before that step, and its weights are numbers.
    """
    run = prepare(config, Path(data), Path(out), resumed, shown)
    shown = shown and run.accelerator.is_main_process
    with Signals() as signals, _watch(run, Path(out), shown, resumed) as watch:
        fraction, number = _loop(run, watch, signals)
        _finish(run, watch, fraction)
    _part(run)
    return number


def _loop(run: Run, watch: Watch, signals: Signals) -> tuple[float, int]:
    """Steps until the budget is spent or a signal comes; how much is spent, and the signal's number."""
    train, progress = run.config.train, run.progress
    window = _Window(run)
    with closing(Steps(run)) as steps:
        while True:
            fraction, number, saving = _agree(run, signals, window)
            if fraction >= 1.0 or number:
                return fraction, number
            if run.data.own_steps is None and draws_own_steps(run.config) and fraction >= train.mc_start:
                watch.tell(show_own_steps(run, lambda: signals.received is not None))
                continue
            step = steps.next(fraction)
            window.add(step, _take_step(run, step, fraction))
            progress.step, progress.tokens = progress.step + 1, progress.tokens + step.seen
            progress.drawn += step.drawn
            progress.seconds = run.clock.seconds()
            if progress.step % LOG_EVERY == 0:
                watch.log("train", fraction, window.close(fraction))
            if fraction >= (progress.measured + 1) * train.evaluate_every:
                _measure(run, watch, fraction)
            if saving:
                _save_last(run)


class Steps:
    """The steps of a run, in order, on its device; a GPU has the next one built while it works on this one."""

    def __init__(self, run: Run) -> None:
        train = run.config.train
        self.run = run
        self.plan = Plan(train.step_tokens, train.step_pairs, train.batch_tokens, *_layout(run))
        self.walk = walk(run.data, self.plan, run.config.seed, run.progress.drawn)
        self.select = Selection(run.accelerator, run.accelerator.unwrap_model(run.objective), run.data, self.plan)
        # What is selected hangs on the weights that the step before leaves.
        ahead = _builds_ahead(run.accelerator.device) and train.select_from == 1
        self.pool = ThreadPoolExecutor(1) if ahead else None
        self.ahead: Future[Step] | None = None

    def next(self, fraction: float) -> Step:
        """This process's part of the next step, `fraction` of the run being over."""
        if self.pool is None:
            return self._build(fraction)
        step = self.ahead.result() if self.ahead else self._build(fraction)
        self.ahead = self.pool.submit(self._build, fraction)
        return step

    def close(self) -> None:
        """Ends the thread."""
        if self.pool is not None:
            self.pool.shutdown()

    def _build(self, fraction: float) -> Step:
        """The next step, dressed by the seed and what was drawn; `fraction` may be that of the step before."""
        run, train, accelerator = self.run, self.run.config.train, self.run.accelerator
        number, records = next(self.walk)
        fraction = max(fraction, number / train.steps if train.steps and self.pool else 0.0)
        parts = [records, *self._more(fraction)]
        choosing = run.config.model.kind == "double-head" and fraction >= train.mc_start
        if draws_own_steps(run.config):
            choosing = bool(run.data.own_steps)
        mc_share = train.mc_share if choosing else 0.0
        short = max(0.0, 1.0 - fraction / train.short_names) if train.short_names else 0.0
        named = (1.0 - train.drawn_names) * (1.0 - short)
        dress = Dress(mc_share, train.renumber_share, train.position_offset, train.offset_share, short, named)
        seed = (run.config.seed, number, 1)
        rank, world = accelerator.process_index, accelerator.num_processes
        select = self.select if len(parts) > 1 else None
        records = np.concatenate(parts)
        step = build_step(run.data, records, self.plan, dress, seed, rank=rank, world=world, select=select)
        return replace(step, drawn=len(parts), batches=[batch.to(accelerator.device) for batch in step.batches])

    def _more(self, fraction: float) -> list[NDArray[np.int64]]:
        """The records of further steps that this one's are selected from."""
        train = self.run.config.train
        selecting = train.select_start <= fraction < train.select_end
        return [next(self.walk)[1] for _ in range(train.select_from - 1)] if selecting else []


def _builds_ahead(device: torch.device) -> bool:
    """Whether the processor would otherwise stand by: a CPU has nobody else to work."""
    return device.type == "cuda"


def _layout(run: Run) -> Layout:
    """How the rows of a batch lie."""
    if run.config.model.kind == "lstm":
        return Layout(math.inf, borrow=False)
    dtype = run.accelerator.unwrap_model(run.objective).dtype
    return best_layout(run.accelerator.device, dtype, run.config.model.dropout)


def _take_step(run: Run, step: Step, fraction: float) -> tuple[float, ...]:
    """One optimisation step; returns the sums of the two losses, of right choices and of the loss of what is told."""
    train = run.config.train
    torch.manual_seed(hash((run.config.seed, run.progress.step, run.accelerator.process_index)))  # dropout
    sums = torch.zeros(4, dtype=torch.float64, device=run.accelerator.device)
    for batch in step.batches:
        losses = run.objective(batch)
        loss = weighted(
            losses, step.tokens, step.pairs, train.lm_weight, train.mc_weight, goal_weight=train.goal_weight
        )
        run.accelerator.backward(loss * run.accelerator.num_processes)
        sums += torch.stack([part.detach().double() for part in (losses.lm, losses.mc, losses.right, losses.goal)])
    sums = run.accelerator.reduce(sums, "sum").cpu()
    norm = sums.new_zeros(())
    if train.clip:
        norm = full(run.accelerator.clip_grad_norm_(run.objective.parameters(), train.clip))
    if not (bool(sums.isfinite().all()) and bool(norm.isfinite())):
        if _sound(run.whole_model()):
            _save_last(run)
        raise NotFiniteError(_not_finite(run, step))
    _set_rates(run.optimizer, rate(fraction, train))
    run.optimizer.step()
    run.optimizer.zero_grad()
    return tuple(sums.tolist())


def rate(fraction: float, train: TrainConfig) -> float:
    """The learning rate's share of its peak: a rise, a level, a fall to zero, each in a straight line."""
    rise = max(fraction / train.warmup, 0.01) if train.warmup else 1.0
    fall = (1.0 - fraction) / train.cooldown if train.cooldown else 1.0
    return max(0.0, min(rise, 1.0, fall))


def _set_rates(optimizer: Any, factor: float) -> None:
    for group in optimizer.param_groups:
        group["lr"] = group["peak"] * factor


def _agree(run: Run, signals: Signals, window: _Window) -> tuple[float, int, bool]:
    """How much of the budget is spent, the signal received, whether to save: the first process decides for all."""
    train, progress = run.config.train, run.progress
    by_steps = progress.step / train.steps if train.steps else 0.0
    by_clock = run.clock.seconds() / (60.0 * train.minutes) if train.minutes else 0.0
    decision = [max(by_steps, by_clock), signals.received or 0, window.due_for_saving(train.save_minutes)]
    if run.accelerator.num_processes > 1:
        broadcast_object_list(decision)
    return float(decision[0]), int(decision[1]), bool(decision[2])


class _Window:
    """Sums over the steps between two log lines, and the time of the last checkpoint."""

    def __init__(self, run: Run) -> None:
        self.run = run
        self.saved = run.clock.seconds()
        self._clear()

    def _clear(self) -> None:
        self.sums = [0.0, 0.0, 0.0, 0.0]
        self.tokens = self.pairs = self.seen = 0
        self.start = self.run.clock.seconds()

    def add(self, step: Step, sums: tuple[float, ...]) -> None:
        self.sums = [a + b for a, b in zip(self.sums, sums, strict=True)]
        self.tokens, self.pairs, self.seen = self.tokens + step.tokens, self.pairs + step.pairs, self.seen + step.seen

    def close(self, fraction: float) -> dict[str, Any]:
        """The log line's values; starts the next window."""
        run, train = self.run, self.run.config.train
        lm = self.sums[0] / max(self.tokens, 1)
        mc = self.sums[1] / self.pairs if self.pairs else None
        goal = self.sums[3] / max(self.tokens, 1) if run.data.goal_reader else None
        seconds = run.clock.seconds()
        values = {
            "step": run.progress.step,
            "seconds": round(seconds, 3),
            "loss": train.lm_weight * lm + train.mc_weight * (mc or 0.0) + train.goal_weight * (goal or 0.0),
            "lm_loss": lm,
            "mc_loss": mc,
            "goal_loss": goal,
            "mc_accuracy": self.sums[2] / self.pairs if self.pairs else None,
            "rate": rate(fraction, train),
            "threads": torch.get_num_threads(),
            "tokens": run.progress.tokens,
            "tokens_per_second": self.seen / max(seconds - self.start, 1e-9),
            "left": seconds * (1.0 - fraction) / max(fraction, 1e-9),
        }
        self._clear()
        return values

    def due_for_saving(self, minutes: float) -> bool:
        """Whether `last` is older than that; true once."""
        due = self.run.clock.seconds() - self.saved > 60.0 * minutes
        if due:
            self.saved = self.run.clock.seconds()
        return due


def _measure(run: Run, watch: Watch, fraction: float) -> None:
    """Measures the validation split, logs it and keeps the best checkpoint."""
    found = measure(run.accelerator.unwrap_model(run.objective), run.validation, run.accelerator.device)
    progress = run.progress
    progress.measured = int(fraction / run.config.train.evaluate_every + 1e-9)
    about = {"step": progress.step, "seconds": round(run.clock.seconds(), 3), "tokens": progress.tokens}
    train = run.config.train
    mc = found.mc_loss or 0.0
    if found.mc_loss is None and draws_own_steps(run.config):
        mc = math.log(2.0)  # A head that has been shown nothing: as likely right as wrong.
    loss = train.lm_weight * found.lm_loss + train.mc_weight * mc
    watch.log(
        "validation", fraction, {**about, "loss": loss, **asdict(found), **_beside_floor(found.lm_loss, run.floor)}
    )
    if math.isfinite(loss) and (progress.best is None or loss < progress.best):
        progress.best = loss
        model = run.whole_model()
        if run.accelerator.is_main_process:
            run.keeper.save_best(model, progress)


def _beside_floor(lm_loss: float, floor: float | None) -> dict[str, float | None]:
    """Perplexity a token, the lowest that any model could reach on these records, and the gap in nats a token."""
    found: dict[str, float | None] = {"floor": floor, "perplexity": math.exp(min(lm_loss, 700.0))}
    if floor is None:
        return found
    return {**found, "perplexity_floor": math.exp(floor), "gap": lm_loss - floor}


def _save_last(run: Run) -> None:
    """Writes `last`, unless the weights are no longer numbers: then the earlier one stays."""
    model = run.whole_model()
    if not _sound(model):
        raise NotFiniteError(f"the weights after step {run.progress.step} are not finite\n{_LOWER}")
    run.progress.seconds = run.clock.seconds()
    state = flatten(run.optimizer) if run.twin is not None or run.accelerator.is_main_process else {}
    if run.accelerator.is_main_process:
        run.keeper.save_last(model, run.progress, state)
    run.accelerator.wait_for_everyone()


def _finish(run: Run, watch: Watch, fraction: float) -> None:
    """Writes the run's last weights, and measures them where the budget is spent."""
    _save_last(run)
    if fraction >= 1.0:
        _measure(run, watch, 1.0)


def _part(run: Run) -> None:
    """Ends the bond of several processes, once all of them are done."""
    if run.accelerator.num_processes > 1:
        run.accelerator.wait_for_everyone()
        # A thread of gloo's frees the last exchange's tensors, for which it takes the interpreter's lock. It has
        # it now: if the interpreter ended first, the thread would abort the process.
        time.sleep(0.1)
    run.accelerator.end_training()


def _sound(model: PreTrainedModel) -> bool:
    """Whether all weights are finite numbers."""
    return all(bool(weight.isfinite().all()) for weight in model.parameters())


_LOWER = "hint: lower `train.lr` and `train.matrix_lr`, then go on from the last checkpoint with `--resume`"


def _not_finite(run: Run, step: Step) -> str:
    named = ", ".join(map(run.data.label, step.records[:20].tolist()))
    more = "" if len(step.records) <= 20 else f" and {len(step.records) - 20} more"
    return (
        f"the loss of step {run.progress.step + 1} or its gradient is not finite; its records: {named}{more}\n{_LOWER}"
    )


def _watch(run: Run, out: Path, shown: bool, resumed: bool) -> Watch:
    """The log of this process: the first one's is `metrics.jsonl` and goes to the trackers too."""
    accelerator, trackers = run.accelerator, run.config.train.trackers
    if trackers:
        accelerator.init_trackers("strips-lm")
    name = "metrics.jsonl" if accelerator.is_main_process else f".metrics.{accelerator.process_index}.jsonl"
    return Watch(out / name, shown, resumed, accelerator if trackers else None)
