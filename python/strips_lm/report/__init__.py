"""One self-contained HTML page of results: no network, no script, light and dark, readable on a telephone.

It reads `results.json` and the `metrics.jsonl` beside the models, and asks the oracle for a few problems' state graphs.
It runs no model.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from html import escape
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING

from strips_lm.evaluate.table import ordered
from strips_lm.report import figures, sections
from strips_lm.report.examples import examples
from strips_lm.report.problems import chosen_problems

if TYPE_CHECKING:
    from strips_lm.evaluate.results import Results


def write_report(results: Results, path: str | Path) -> None:
    """Write the page, whole or not at all."""
    target = Path(path)
    part = target.with_name(target.name + ".part")
    part.write_text(page(results), encoding="utf-8")
    part.replace(target)


def page(results: Results) -> str:
    """The page's text."""
    style = (files("strips_lm.report") / "style.css").read_text(encoding="utf-8")
    parts = [part for part in _parts(results) if part.body]
    links = "".join(f'<a href="#{part.key}">{part.title}</a>' for part in parts)
    return (
        '<!doctype html><html lang="en"><head><meta charset="utf-8"><title>strips-lm report</title>'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<style>{style}</style></head><body><header><h1>Planners, checked by the oracle</h1>{_opening(results)}"
        f"<nav>{links}</nav></header><main>{''.join(map(_section, parts))}{_folds(results)}</main></body></html>\n"
    )


@dataclass(frozen=True, slots=True)
class Part:
    """A section of the page; one without a body is left out."""

    key: str
    title: str
    note: str
    body: str


def _parts(results: Results) -> list[Part]:
    """The sections from top to bottom."""
    return [
        Part("table", "Results", _TABLE, sections.table(results)),
        Part("suites", "Valid plans by suite", _VALID, _figure(figures.validity(results))),
        Part("decoding", "Ways of decoding", _DECODE, _figure(figures.by_decode(results))),
        Part("lengths", "Valid plans by length", _LENGTH, _figure(figures.by_length(results))),
        Part("failures", "Where plans fail", _FAIL, _figure(figures.verdicts(results))),
        Part("steps", "First step at fault", _FIRST, _figure(figures.failing_steps(results))),
        Part("training", "Training", _TRAINING, _figure(figures.losses(results.models))),
        Part("problems", "Plans in their state graphs", _GRAPH, chosen_problems(results)),
        Part("examples", "What the models wrote", _EXAMPLES, examples(results)),
    ]


_TABLE = (
    "Valid plans in per cent with the 95 % interval (Wilson; prompts of one problem count as one). A plan is valid if "
    "every step can be executed and "
    "the last state satisfies the goal of the prompt's own PDDL problem. Perplexity is 2^H over the plans of the "
    "first suite; its floor is what a perfect model reaches. Choice is how often the second head prefers a plan "
    "to its corruption."
)
_VALID = "Without any help; the lines are 95 % intervals."
_DECODE = "With * the oracle took part in decoding or choosing."
_LENGTH = "By the number of steps of the shortest plan, all suites together, with 95 % intervals."
_FAIL = "What the oracle says of the plans that are not valid, in per cent of all prompts."
_FIRST = (
    "Of the plans that fail at a step, where they do: the first step that cannot be applied, or one past the last"
    " where the goal is not reached. In brackets, how many plans there are."
)
_TRAINING = (
    "LM loss on training (solid) and validation data (dashed), and the floor that no model of the validation data"
    " can go below. Tokenizers differ in how many tokens a plan has, so only curves of one tokenizer compare."
)
_GRAPH = (
    'States from the initial one <span class="key init">0</span> down to the goal <span class="key goal">n</span>, '
    'with a model&rsquo;s steps <span class="key step">n</span> over the oracle&rsquo;s shortest plan '
    '<span class="key oracle"></span>. Bars and numbers: how probable the model found each step, and then its '
    "state. Point at a state to read it."
)
_EXAMPLES = (
    "The same prompt, every model. Marked: the action, and the atoms that are new in the state; struck out: those"
    " that are gone. Red: the step at fault."
)


def _section(part: Part) -> str:
    note = f'<p class="faint">{part.note}</p>'
    return f'<section id="{part.key}"><h2>{part.title}</h2>{note}{part.body}</section>'


def _folds(results: Results) -> str:
    """What only some readers want."""
    return (
        _folded("Every score", sections.details(results))
        + _folded("Perplexity and multiple choice", sections.likelihoods(results))
        + _folded("How to repeat this", _about(results))
    )


def _folded(title: str, body: str) -> str:
    return f"<details><summary>{title}</summary>{body}</details>"


def _opening(results: Results) -> str:
    models, suites = len(results.models), len(ordered(s.suite for s in results.scores))
    prompts = sum(s.prompts for s in results.scores)
    of = f"{models} model{'s' * (models != 1)}, {suites} suite{'s' * (suites != 1)}"
    line = f"{of}, {prompts:,} plans checked; {escape(results.created[:10])}"
    return f'<p class="faint">{line}</p>{sections.cards(results)}'


def _figure(drawn: str) -> str:
    return f"<figure>{drawn}</figure>" if drawn else ""


def _about(results: Results) -> str:
    text = json.dumps({"config": results.config, "versions": results.versions, "data": results.data}, indent=1)
    return f"<p><code>strips-lm evaluate --reproduce results.json</code></p><pre>{escape(text)}</pre>"
