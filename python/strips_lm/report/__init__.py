"""One self-contained HTML page of results: no network, no script, light and dark, readable on a telephone.

It reads `results.json` and the `metrics.jsonl` beside the models, and asks the oracle for one problem's state graph.
It runs no model.
"""

from __future__ import annotations

import json
from html import escape
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any

from strips_lm import _native
from strips_lm.evaluate.table import ordered
from strips_lm.report import charts, graph, sections
from strips_lm.report.charts import Bar, Curve

if TYPE_CHECKING:
    from collections.abc import Sequence

    from strips_lm.evaluate.results import Example, Model, Results, Score

MAX_STATES = 400
"""A state graph with more states than this is not drawn."""


def write_report(results: Results, path: str | Path) -> None:
    """Write the page, whole or not at all."""
    target = Path(path)
    part = target.with_name(target.name + ".part")
    part.write_text(page(results), encoding="utf-8")
    part.replace(target)


def page(results: Results) -> str:
    """The page's text."""
    style = (files("strips_lm.report") / "style.css").read_text(encoding="utf-8")
    body = "".join(f"<section>{part}</section>" for part in _parts(results) if part)
    return (
        '<!doctype html><html lang="en"><head><meta charset="utf-8"><title>strips-lm report</title>'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<style>{style}</style></head><body><h1>Planners, checked by the oracle</h1>{body}</body></html>\n"
    )


def _parts(results: Results) -> list[str]:
    """The sections from top to bottom; one that has nothing to show is empty."""
    return [
        _opening(results),
        _section("Table 1", _TABLE, sections.table(results)),
        _section("Valid plans by suite", _VALID, validity(results)),
        _section("Training", _TRAINING, losses(results.models)),
        _section("One problem and a plan in its state graph", _GRAPH, state_graph(results)),
        _section("What the models wrote", _EXAMPLES, examples(results)),
        _section("Valid plans by length", _LENGTH, by_length(results)),
        _section("Where plans fail", _FAIL, verdicts(results)),
        _folded("Every score", sections.details(results)),
        _folded("Perplexity and multiple choice", sections.likelihoods(results)),
        _folded("How to repeat this", _about(results)),
    ]


_TABLE = (
    "Share of valid plans in per cent with its 95 % interval (Wilson). A plan is valid if every step can be executed "
    "and the last state satisfies the goal of the prompt's own PDDL problem. Perplexity is 2^H over the plans, on "
    "the first suite; its floor is what a perfect model reaches. Lines with * had the oracle's help while decoding."
)
_VALID = "Greedy decoding without any help, or the first way of decoding that was run."
_TRAINING = (
    "LM loss in nats a token on training (solid) and validation data (dashed). Tokenizers differ in how many "
    "tokens a plan has, so only curves of one tokenizer compare."
)
_GRAPH = (
    "States on plans of up to two steps more than this one. The initial state is blue, goal states are red, the plan's "
    "path is green. Hover over a state to read it."
)
_EXAMPLES = "The same prompt, every model. Actions and the atoms that a state adds are marked."
_LENGTH = "By the number of steps of the shortest plan."
_FAIL = "What the oracle says of the invalid plans, in per cent of all prompts."


def _section(title: str, note: str, body: str) -> str:
    return f"<h2>{title}</h2><p class=faint>{note}</p>{body}" if body else ""


def _folded(title: str, body: str) -> str:
    return f"<details><summary>{title}</summary>{body}</details>"


def _opening(results: Results) -> str:
    prompts = sum(s.prompts for s in results.scores)
    suites = len(ordered(s.suite for s in results.scores))
    line = f"{len(results.models)} models, {suites} suites, {prompts} plans checked; {escape(results.created)}."
    return f"<p class=faint>{line}</p>{sections.cards(results)}"


def free_scores(results: Results) -> list[Score]:
    """The scores of the first way of decoding."""
    first = results.scores[0].decode
    return [s for s in results.scores if s.decode == first]


def validity(results: Results) -> str:
    """Bars of % valid with intervals, by suite and model."""
    scores = free_scores(results)
    suites = ordered(s.suite for s in scores)
    series: dict[str, list[Bar | None]] = {}
    for model in ordered(s.model for s in scores):
        found = {s.suite: Bar(100 * s.share, 100 * s.valid_low, 100 * s.valid_high) for s in scores if s.model == model}
        series[model] = [found.get(suite) for suite in suites]
    return _figure(charts.bars(suites, series, "% valid"))


def losses(models: Sequence[Model]) -> str:
    """Loss curves (Figure 3) of the models whose `metrics.jsonl` is at hand."""
    lines: list[Curve] = []
    for number, model in enumerate(models):
        found = read_metrics(model.path)
        for kind in ("train", "validation"):
            rows = [row for row in found if row.get("kind") == kind and row.get("lm_loss") is not None]
            if rows:
                name = model.name + (" (validation)" if kind == "validation" else "")
                x, y = [row["step"] for row in rows], [row["lm_loss"] for row in rows]
                lines.append(Curve(name, x, y, number, dashed=kind == "validation"))
    return _figure(charts.curves(lines, "optimisation steps", "LM loss", log=True)) if lines else ""


def read_metrics(folder: str | Path) -> list[dict[str, Any]]:
    """The lines of a run's `metrics.jsonl`, in the folder or the one above; nothing where there is none."""
    for place in (Path(folder), Path(folder).parent):
        path = place / "metrics.jsonl"
        if path.is_file():
            return [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines() if line.strip()]
    return []


def state_graph(results: Results) -> str:
    """The state graph of the first example whose graph is small enough, with its plan (Figure 1)."""
    for found in results.examples:
        drawn = _draw_graph(found, results)
        if drawn:
            return drawn
    return ""


def _draw_graph(found: Example, results: Results) -> str:
    path = Path(results.data) / "domain.pddl"
    if not path.is_file():
        return ""
    domain = _native.Domain.parse(path.read_text(encoding="utf-8"), str(path))
    task = _native.Task(domain, _native.Problem.parse(found.problem, domain))
    valid = next((o for o in found.outputs if o.verdict == "valid"), None)
    plan = (valid.plan if valid else found.reference).split("\n")
    plan = [line.strip() for line in plan if line.strip()]
    spelled = _spell(task, len(plan))
    if spelled is None:
        return ""
    whose = f"the plan of {valid.model}" if valid else "one of the oracle's plans"
    caption = f"{escape(found.suite)}, prompt {found.index}: {len(spelled.states)} states; the path is {escape(whose)}."
    drawn = graph.draw(spelled, plan)
    return f'<figure><div class="wide">{drawn}</div><figcaption>{caption}</figcaption></figure>'


def _spell(task: _native.Task, steps: int) -> graph.StateGraph | None:
    """The graph of all plans of two steps more than the plan's, or as many more as can be drawn."""
    for horizon in (steps + 2, steps + 1, steps):
        try:
            return graph.StateGraph(*_native.state_graph(task, horizon, max_states=MAX_STATES))
        except _native.LimitError:
            continue
    return None


def examples(results: Results, count: int = 3) -> str:
    """The prompts that tell the models apart best come first: those with the most different verdicts."""
    ranked = sorted(results.examples, key=lambda e: (-len({o.verdict for o in e.outputs}), e.suite != "unseen-objects"))
    return "".join(sections.example(found) for found in ranked[:count])


def by_length(results: Results) -> str:
    """% valid over the shortest plan's length, all suites together."""
    lines = []
    for number, model in enumerate(ordered(s.model for s in free_scores(results))):
        counts: dict[int, list[int]] = {}
        for score in (s for s in free_scores(results) if s.model == model):
            for length, (right, tried) in score.by_length.items():
                found = counts.setdefault(int(length), [0, 0])
                found[0], found[1] = found[0] + right, found[1] + tried
        lengths = sorted(length for length, (_, tried) in counts.items() if tried >= 5)
        shares = [100 * counts[length][0] / counts[length][1] for length in lengths]
        lines.append(Curve(model, lengths, shares, number))
    return _figure(charts.curves(lines, "steps of the shortest plan", "% valid", percent=True))


def verdicts(results: Results) -> str:
    """Stacked verdicts of the invalid plans, by model and suite."""
    scores = [s for s in free_scores(results) if s.valid < s.prompts]
    names = [name for name in ordered(name for s in scores for name in s.verdicts) if name != "valid"]
    if not names:
        return ""
    parts = {n.replace("_", " "): [100 * s.verdicts.get(n, 0) / s.prompts for s in scores] for n in names}
    return _figure(charts.stacks([f"{s.model}, {s.suite}" for s in scores], parts, "% of prompts"))


def _figure(svg: str) -> str:
    return f'<figure><div class="wide">{svg}</div></figure>'


def _about(results: Results) -> str:
    text = json.dumps({"config": results.config, "versions": results.versions, "data": results.data}, indent=1)
    return f"<p><code>strips-lm evaluate --reproduce results.json</code></p><pre>{escape(text)}</pre>"
