"""What a training run shows and obeys: metrics, progress bar, signals, the clock. It knows nothing of learning."""

from __future__ import annotations

import json
import signal
import sys
import time
from contextlib import AbstractContextManager
from typing import TYPE_CHECKING, Any, Self

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

if TYPE_CHECKING:
    from pathlib import Path
    from types import FrameType, TracebackType

    from accelerate import Accelerator


class Signals(AbstractContextManager["Signals"]):
    """Remembers SIGINT and SIGTERM instead of dying of them, so that a step can end and a checkpoint be written."""

    def __init__(self) -> None:
        self.received: int | None = None
        self._before: dict[int, Any] = {}

    def __enter__(self) -> Self:
        for number in (signal.SIGINT, signal.SIGTERM):
            self._before[number] = signal.signal(number, self._remember)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)

    def _remember(self, number: int, _frame: FrameType | None) -> None:
        if self.received is not None:
            raise KeyboardInterrupt
        self.received = number


def say(line: str) -> None:
    """Writes a line that stays, on standard error."""
    sys.stderr.write(f"{line}\n")


class Clock:
    """Seconds trained, over all the runs that a resumed run is made of."""

    def __init__(self, before: float) -> None:
        self._start = time.monotonic() - before

    def seconds(self) -> float:
        """Seconds so far."""
        return time.monotonic() - self._start


class Watch(AbstractContextManager["Watch"]):
    """`metrics.jsonl`, accelerate's trackers and a progress bar on standard error; no bar where `shown` is false."""

    def __init__(self, path: Path, shown: bool, resumed: bool, trackers: Accelerator | None = None) -> None:
        self._trackers = trackers
        self._file = path.open("a" if resumed else "w", encoding="utf-8")
        self._shown = shown
        self._bar = Progress(
            TextColumn("[bold]train"),
            BarColumn(bar_width=30),
            TextColumn("{task.percentage:5.1f}%  {task.fields[note]}"),
            TimeElapsedColumn(),
            console=Console(stderr=True),
            disable=not (shown and sys.stderr.isatty()),
        )
        self._task = self._bar.add_task("train", total=1.0, note="")

    def __enter__(self) -> Self:
        self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bar.stop()
        self._file.close()

    def tell(self, line: str) -> None:
        """Writes a line that stays above the bar."""
        if self._shown:
            self._bar.console.print(line, highlight=False)

    def log(self, kind: str, fraction: float, values: dict[str, Any]) -> None:
        """Writes one line to `metrics.jsonl`, hands it to the trackers and moves the bar."""
        self._file.write(json.dumps({"kind": kind, "progress": round(fraction, 5), **values}) + "\n")
        self._file.flush()
        if self._trackers is not None:
            numbers = {f"{kind}/{name}": value for name, value in values.items() if value is not None}
            self._trackers.log(numbers, step=values.get("step"))
        self._bar.update(self._task, completed=min(fraction, 1.0), note=_note(values))
        if kind == "validation" and self._shown and self._bar.disable:
            sys.stderr.write(f"{100 * fraction:5.1f}%  {_note(values)}\n")


def _note(values: dict[str, Any]) -> str:
    shown = ("step", "loss", "perplexity", "perplexity_floor", "gap", "mc_accuracy", "tokens_per_second", "left")
    return "  ".join(f"{name} {_short(values[name])}" for name in shown if values.get(name) is not None)


def _short(value: float) -> str:
    return f"{value:.0f}" if abs(value) >= 100 or value == int(value) else f"{value:.4f}"
