"""The whole of it with one call: data set, models, scores, page. Every stage that is done is skipped when called again.

A stage is done when its last file is there: `manifest.json` of the data set, `trained.json` of a model, a results file
of each evaluation. So Ctrl-C costs at most the seconds since the last checkpoint.

Models are trained two at a time, each by `strips-lm train` in a process with half of the cores: at these sizes two
processes of one thread do nearly twice the work of one process with two threads (docs/experiments.md).
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path  # noqa: TC003  (dataclass fields are public types)
from typing import TYPE_CHECKING

from strips_lm.config import RunConfig

if TYPE_CHECKING:
    from collections.abc import Callable

    from strips_lm.evaluate.results import Results

    Tell = Callable[[str], None]
    Tick = Callable[[str, int, int], None]


@dataclass(frozen=True, slots=True)
class Entrant:
    """A model of the quickstart: its name, and the preset and kind that it is trained by."""

    name: str
    preset: str
    kind: str


@dataclass(frozen=True, slots=True)
class Round:
    """Models that are trained side by side, and their share of the training time."""

    share: float
    entrants: tuple[Entrant, ...]


ROUNDS = (
    Round(0.7, (Entrant("double-head", "tiny", "double-head"), Entrant("lm-head", "tiny", "lm-head"))),
    Round(0.3, (Entrant("lstm", "lstm", "lstm"), Entrant("double-head-spelled", "spelled", "double-head"))),
)
"""The report's three models on the same data; and the double head on names as they are spelled."""

DATA = "data"
"""The folder of the data set."""

ENTRANTS = tuple(entrant for group in ROUNDS for entrant in group.entrants)

POLL_SECONDS = 0.5
"""Between two looks at the metrics of models in training."""


class TrainingError(RuntimeError):
    """A model's training failed; the message ends with what it said last."""


class Interrupted(KeyboardInterrupt):
    """A signal ended a stage; what it had done is kept."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Quickstart:
    """What to make, and where."""

    out: Path
    minutes: float = 13.0
    """Minutes of training, all models together."""
    pairs: int = 0
    """Pairs of the data set; 0 is as many as its preset has."""
    limit: int = 300
    """Prompts a suite."""
    seed: int = 0
    tell: Tell = print
    tick: Tick | None = None

    def run(self) -> Results:
        """All stages; the page is `report.html` in the folder."""
        self.out.mkdir(parents=True, exist_ok=True)
        self._make_data()
        for group in ROUNDS:
            self._train(group)
        results = self._evaluate()
        self._report(results)
        return results

    def _make_data(self) -> None:
        from strips_lm.shards import write_data_set
        from strips_lm.sources import read_sources

        if (self.out / DATA / "manifest.json").is_file():
            return
        pairs = [f"data.pairs={self.pairs}"] if self.pairs else []
        config = RunConfig.load("tiny", [*pairs, f"seed={self.seed}"])
        self.tell(f"{DATA}: {config.data.pairs} pairs, every plan and every corruption proven by the oracle")
        sources = read_sources(config.data.domain, config.data.problems)
        write_data_set(self.out / DATA, config, sources, tick=self.tick or _no_tick)

    def _train(self, group: Round) -> None:
        """The models of a round at the same time, each from its last checkpoint if it has one."""
        minutes = self.minutes * group.share
        missing = [entrant for entrant in group.entrants if not (self._model(entrant) / "trained.json").is_file()]
        if not missing:
            return
        self.tell(f"train: {' and '.join(entrant.name for entrant in missing)}, {minutes:.1f} minutes")
        threads = max(1, (os.cpu_count() or 1) // len(missing))
        running = {entrant: self._start(entrant, minutes, threads) for entrant in missing}
        try:
            while any(process.poll() is None for process in running.values()):
                time.sleep(POLL_SECONDS)
                if self.tick:
                    self.tick("train", int(1000 * min(map(self._progress, missing))), 1000)
        finally:
            for process in running.values():
                process.terminate()  # writes a checkpoint; does nothing to one that has ended
            codes = {entrant: process.wait() for entrant, process in running.items()}
        for entrant, code in codes.items():
            self._finish(entrant, code)

    def _model(self, entrant: Entrant) -> Path:
        return self.out / "models" / entrant.name

    def _start(self, entrant: Entrant, minutes: float, threads: int) -> subprocess.Popen[bytes]:
        out = self._model(entrant)
        out.mkdir(parents=True, exist_ok=True)
        command = [sys.executable, "-m", "strips_lm", "train", str(self.out / DATA), "--out", str(out)]
        command += ["--preset", entrant.preset, "--model", entrant.kind]
        command += ["--set", f"train.minutes={minutes}", "--set", f"seed={self.seed}"]
        if (out / "last" / "trainer.json").is_file():
            command.append("--resume")
        environment = {**os.environ, "OMP_NUM_THREADS": str(threads)}
        with (out / "train.log").open("ab") as log:
            # In a session of its own Ctrl-C reaches only this process, which then asks each model once to stop.
            return subprocess.Popen(
                command, stdin=subprocess.DEVNULL, stdout=log, stderr=log, env=environment, start_new_session=True
            )

    def _progress(self, entrant: Entrant) -> float:
        """The share of its training that the model's last line of metrics tells."""
        path = self._model(entrant) / "metrics.jsonl"
        lines = path.read_text(encoding="utf-8").splitlines() if path.is_file() else []
        return float(json.loads(lines[-1])["progress"]) if lines else 0.0

    def _finish(self, entrant: Entrant, code: int) -> None:
        """Marks a model as trained, or says why it is not."""
        out = self._model(entrant)
        if code in (130, 143):
            raise Interrupted
        if code:
            said = (out / "train.log").read_text(encoding="utf-8", errors="replace").splitlines()[-5:]
            raise TrainingError("\n".join([f"training {entrant.name} failed (exit {code})", *said]))
        progress = json.loads((out / "last" / "trainer.json").read_text(encoding="utf-8"))
        (out / "trained.json").write_text(json.dumps(progress) + "\n", encoding="utf-8")

    def _evaluate(self) -> Results:
        """Each model's results in a file of its own, then all in `results.json`."""
        found = [self._evaluate_one(entrant) for entrant in ENTRANTS]
        for more in found[1:]:
            found[0].join(more)
        found[0].save(self.out / "results.json")
        return found[0]

    def _evaluate_one(self, entrant: Entrant) -> Results:
        from strips_lm.evaluate.results import Results

        path = self.out / "results" / f"{entrant.name}.json"
        if path.is_file():
            return Results.load(path)
        from strips_lm.evaluate.evaluation import Evaluation
        from strips_lm.evaluate.suites import DataFolder

        self.tell(f"evaluate: {entrant.name}")
        config = RunConfig.load(
            None, [f"evaluate.limit={self.limit}", f"evaluate.pairs={self.limit}", f"seed={self.seed}"]
        )
        results = Evaluation(config, DataFolder(self.out / DATA), self.tell, self.tick).run([self._model(entrant)])
        results.save(path)
        return results

    def _report(self, results: Results) -> None:
        from strips_lm.report import write_report

        write_report(results, self.out / "report.html")
        self.tell(f"report: {self.out / 'report.html'}{os.linesep}")


def _no_tick(_what: str, _done: int, _total: int) -> None:
    """No progress is shown."""
