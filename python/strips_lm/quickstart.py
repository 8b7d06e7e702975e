"""The whole of it with one call: data set, models, scores, page. Every stage that is done is skipped when called again.

A stage is done when its last file is there: `manifest.json` of the data set, `trained.json` of a model, a results file
of each evaluation. So Ctrl-C costs at most the seconds since the last checkpoint.
"""

from __future__ import annotations

import json
import os
from dataclasses import dataclass, replace
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
    """A model of the quickstart: its name, what it is trained by, and its share of the training time."""

    name: str
    preset: str
    kind: str
    share: float


ENTRANTS = (
    Entrant("double-head", "tiny", "double-head", 0.35),
    Entrant("lm-head", "tiny", "lm-head", 0.25),
    Entrant("lstm", "lstm", "lstm", 0.12),
    Entrant("double-head-bpe", "bpe", "double-head", 0.28),
)
"""The report's three models, and the double head on text as it is spelled; the same data for all."""


class Interrupted(KeyboardInterrupt):
    """A signal ended a stage; what it had done is kept."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Quickstart:
    """What to make, and where."""

    out: Path
    minutes: float = 12.0
    """Minutes of training, all models together."""
    pairs: int = 24_000
    """Pairs of the data set."""
    limit: int = 500
    """Prompts a suite."""
    seed: int = 0
    tell: Tell = print
    tick: Tick | None = None

    def run(self) -> Results:
        """All stages; the page is `report.html` in the folder."""
        self.out.mkdir(parents=True, exist_ok=True)
        self._make_data()
        for entrant in ENTRANTS:
            self._train(entrant)
        results = self._evaluate()
        self._report(results)
        return results

    @property
    def data(self) -> Path:
        """The data set's folder."""
        return self.out / "data"

    def _make_data(self) -> None:
        if (self.data / "manifest.json").is_file():
            return
        from strips_lm.shards import write_data_set
        from strips_lm.sources import read_sources

        self.tell(f"data: {self.pairs} pairs, every plan and every corruption proven by the oracle")
        config = RunConfig.load(None, [f"data.pairs={self.pairs}", f"seed={self.seed}"])
        sources = read_sources(config.data.domain, config.data.problems)
        write_data_set(self.data, config, sources, tick=self.tick or _no_tick)

    def _train(self, entrant: Entrant) -> None:
        """One model, from its last checkpoint if it has one."""
        out = self.out / "models" / entrant.name
        if (out / "trained.json").is_file():
            return
        from strips_lm.train import train

        minutes = self.minutes * entrant.share
        self.tell(f"train: {entrant.name}, {minutes:.1f} minutes")
        overrides = [f"model.kind={entrant.kind}", f"train.minutes={minutes}", f"seed={self.seed}"]
        config = RunConfig.load(entrant.preset, overrides)
        number = train(config, self.data, out, resumed=(out / "last" / "trainer.json").is_file())
        if number:
            raise Interrupted
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
        config = RunConfig.load(None, [f"evaluate.limit={self.limit}", f"seed={self.seed}"])
        data = DataFolder(self.data)
        present = [suite for suite in config.evaluate.suites if suite in data.suites()]
        config = replace(config, evaluate=replace(config.evaluate, suites=tuple(present)))
        results = Evaluation(config, data, self.tell, self.tick).run([self.out / "models" / entrant.name])
        results.save(path)
        return results

    def _report(self, results: Results) -> None:
        from strips_lm.report import write_report

        write_report(results, self.out / "report.html")
        self.tell(f"report: {self.out / 'report.html'}{os.linesep}")


def _no_tick(_what: str, _done: int, _total: int) -> None:
    """No progress is shown."""
