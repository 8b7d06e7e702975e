"""The report's charts from its results: what is drawn, not how. It reads `metrics.jsonl` beside the models."""

from __future__ import annotations

import json
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

from strips_lm.evaluate.statistics import wilson
from strips_lm.evaluate.table import ordered
from strips_lm.report import charts
from strips_lm.report.charts import Curve, Share

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from strips_lm.evaluate.results import Model, Results, Score

FEW = 5
"""Shares of fewer prompts than this are not drawn."""


def free_scores(results: Results) -> list[Score]:
    """The scores of the way of decoding that comes first: greedy, where there is that."""
    decodes = ordered(s.decode for s in results.scores if not s.oracle_helps) or [results.scores[0].decode]
    first = "greedy" if "greedy" in decodes else decodes[0]
    return [s for s in results.scores if s.decode == first]


def validity(results: Results) -> str:
    """% valid with intervals, by suite and model."""
    return _shares(free_scores(results), lambda score: score.model)


def by_decode(results: Results) -> str:
    """% valid with intervals, by suite and way of decoding, of each model that was decoded in several ways."""
    drawn = []
    for model in ordered(s.model for s in results.scores):
        scores = [s for s in results.scores if s.model == model]
        if len(ordered(s.decode for s in scores)) > 1:
            drawn.append(f"<h3>{escape(model)}</h3>{_shares(scores, _decode_name, model)}")
    return "".join(drawn)


def _decode_name(score: Score) -> str:
    return f"{score.decode} *" if score.oracle_helps else score.decode


def _shares(scores: Sequence[Score], key: Callable[[Score], str], name: str = "") -> str:
    suites = ordered(s.suite for s in scores)
    series: dict[str, list[Share | None]] = {}
    for line in ordered(map(key, scores)):
        found = {s.suite: Share(100 * s.share, 100 * s.valid_low, 100 * s.valid_high) for s in scores if key(s) == line}
        series[line] = [found.get(suite) for suite in suites]
    return charts.shares(suites, series, "% valid", f"% valid by suite {name}".strip())


def losses(models: Sequence[Model]) -> str:
    """Loss curves (Figure 3) of the models whose `metrics.jsonl` is at hand, and the floors of the validation data."""
    lines: list[Curve] = []
    floors: set[float] = set()
    for number, model in enumerate(models):
        found = read_metrics(model.path)
        floors |= {round(row["floor"], 5) for row in found if row.get("floor")}
        name = model.name
        for kind in ("train", "validation"):
            rows = [row for row in found if row.get("kind") == kind and row.get("lm_loss") is not None]
            if rows:
                x, y = [row["step"] for row in rows], [row["lm_loss"] for row in rows]
                lines.append(Curve(name, x, y, number, dashed=kind == "validation"))
                name = ""
    if not lines:
        return ""
    return charts.curves(lines, "optimisation steps", "LM loss, nats a token", log=True, floors=sorted(floors))


def read_metrics(folder: str | Path) -> list[dict[str, Any]]:
    """The lines of a run's `metrics.jsonl`, in the folder or the one above; nothing where there is none."""
    for place in (Path(folder), Path(folder).parent):
        path = place / "metrics.jsonl"
        if path.is_file():
            return [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines() if line.strip()]
    return []


def by_length(results: Results) -> str:
    """% valid over the shortest plan's length with its interval, all suites together."""
    lines = []
    for number, model in enumerate(ordered(s.model for s in free_scores(results))):
        counts = _add_up(s.by_length for s in free_scores(results) if s.model == model)
        lengths = sorted(length for length, (_, tried) in counts.items() if tried >= FEW)
        right, tried = [counts[n][0] for n in lengths], [counts[n][1] for n in lengths]
        worth = _worth([s for s in free_scores(results) if s.model == model])
        spread = [wilson(a, b, worth * b) for a, b in zip(right, tried, strict=True)]
        low, high = [100 * a for a, _ in spread], [100 * b for _, b in spread]
        shares = [100 * a / b for a, b in zip(right, tried, strict=True)]
        lines.append(Curve(model, lengths, shares, number, low=low, high=high))
    return charts.curves(lines, "steps of the shortest plan", "% valid", percent=True)


def _worth(scores: Sequence[Score]) -> float:
    """What a prompt is worth, on average: less than one where problems come more than once."""
    counted = [s for s in scores if s.effective is not None]
    return sum(s.effective or 0.0 for s in counted) / sum(s.prompts for s in counted) if counted else 1.0


def _add_up(counts: Iterable[dict[str, list[int]]]) -> dict[int, list[int]]:
    """[valid, prompts] by length over suites."""
    total: dict[int, list[int]] = {}
    for suite in counts:
        for length, (right, tried) in suite.items():
            found = total.setdefault(int(length), [0, 0])
            found[0], found[1] = found[0] + right, found[1] + tried
    return total


def verdicts(results: Results) -> str:
    """Verdicts of the plans that are not valid, by model and suite."""
    scores = [s for s in free_scores(results) if s.valid < s.prompts]
    names = [name for name in ordered(name for s in scores for name in s.verdicts) if name != "valid"]
    if not names:
        return ""
    parts = {n.replace("_", " "): [100 * s.verdicts.get(n, 0) / s.prompts for s in scores] for n in names}
    return charts.stacks([f"{s.model}, {s.suite}" for s in scores], parts, "% of prompts", "verdicts")


def failing_steps(results: Results) -> str:
    """Where plans first fail, by model, as shares of its plans that fail at a step."""
    free = free_scores(results)
    models = ordered(s.model for s in free)
    lines = []
    for number, model in enumerate(models):
        counts: dict[int, int] = {}
        for score in (s for s in free if s.model == model):
            for step, count in score.failed_at.items():
                if step != "-":
                    counts[int(step)] = counts.get(int(step), 0) + count
        total = sum(counts.values())
        if total >= FEW:
            steps = range(1, max(counts) + 1)
            lines.append(Curve(f"{model} ({total})", steps, [100 * counts.get(n, 0) / total for n in steps], number))
    return charts.curves(lines, "first step at fault", "% of failures", integer=True) if lines else ""
