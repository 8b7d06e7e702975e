"""Table 1 for a terminal: perplexity, multiple-choice accuracy and the share of valid plans, per model and suite."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeVar

from rich.table import Table

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from strips_lm.evaluate.results import Likelihood, Results, Score

_T = TypeVar("_T")


def percent(part: float, whole: float) -> str:
    """A share in per cent with one decimal, or a dash of nothing."""
    return f"{100 * part / whole:.1f}" if whole else "–"


def interval(score: Score) -> str:
    """Per cent valid and its 95 % interval."""
    return f"{100 * score.share:.1f} [{100 * score.valid_low:.1f}, {100 * score.valid_high:.1f}]"


def summary(results: Results) -> Table:
    """The report's Table 1: one line a model, one column a suite, free greedy decoding first."""
    table = Table(title="Table 1", caption=_caption(results), caption_justify="left")
    suites = ordered(score.suite for score in results.scores)
    for name in ("model", "decode", "perplexity", "choice %"):
        table.add_column(name, justify="left" if name in {"model", "decode"} else "right", no_wrap=True)
    for suite in suites:
        table.add_column(suite, justify="right")
    for model, decode in _lines(results):
        table.add_row(*_cells(results, model, decode, suites))
    return table


def _caption(results: Results) -> str:
    prompts = sorted({score.prompts for score in results.scores})
    spread = f"{prompts[0]} to {prompts[-1]}" if len(prompts) > 1 else "".join(map(str, prompts))
    return f"% valid plans of {spread} prompts a suite, checked by the oracle; * the oracle took part in decoding"


def _lines(results: Results) -> Iterator[tuple[str, str]]:
    """(model, decode) of each line, the ones without the oracle's help first."""
    ranked = sorted(results.scores, key=lambda s: s.oracle_helps)
    yield from ordered((s.model, s.decode) for s in ranked)


def _cells(results: Results, model: str, decode: str, suites: list[str]) -> list[str]:
    scores = {s.suite: s for s in results.scores if (s.model, s.decode) == (model, decode)}
    mark = "*" if any(s.oracle_helps for s in scores.values()) else ""
    return [
        model,
        decode + mark,
        *likelihood_cells([k for k in results.likelihoods if k.model == model]),
        *(interval(scores[suite]) if suite in scores else "–" for suite in suites),
    ]


def likelihood_cells(found: list[Likelihood]) -> tuple[str, str]:
    """Perplexity and multiple-choice accuracy on the first suite measured."""
    if not found:
        return "–", "–"
    return f"{found[0].perplexity:.4f}", percent(found[0].choices_right, found[0].choices)


def failures(results: Results) -> Table:
    """Why the invalid plans fail: verdicts, unfinished and malformed texts, wrong states."""
    names = ordered(verdict for s in results.scores for verdict in s.verdicts)
    table = Table(title="What the oracle says", caption="prompts by verdict; states: share of right ones, in %")
    for name in ("model", "suite", "decode"):
        table.add_column(name, no_wrap=True)
    for name in (*names, "unfinished", "optimal %", "states", "prompts/s", "tokens/s"):
        table.add_column(name.replace("_", " "), justify="right")
    for s in results.scores:
        counts = [str(s.verdicts.get(name, 0)) for name in names]
        rates = [percent(s.optimal, s.valid), percent(s.states_right, s.states)]
        speed = [f"{s.prompts_per_second:.0f}", f"{s.tokens_per_second:.0f}"]
        table.add_row(s.model, s.suite, s.decode, *counts, str(s.unfinished), *rates, *speed)
    return table


def likelihoods(results: Results) -> Table:
    """Perplexity with its floor and its tokens, and the second head per kind of negative."""
    table = Table(title="Perplexity and multiple choice", caption="perplexity is 2^H over the plans' tokens")
    for name in ("model", "suite"):
        table.add_column(name, no_wrap=True)
    for name in ("tokens", "perplexity", "floor", "bits/plan", "floor", "choice %", "by kind of negative"):
        table.add_column(name, justify="right")
    for k in results.likelihoods:
        kinds = ", ".join(f"{kind} {percent(*found)}" for kind, found in sorted(k.by_negative.items()))
        floors = [f"{k.floor:.4f}" if k.floor else "–", f"{k.floor_bits_per_plan or 0:.2f}"]
        cells = [str(k.tokens), f"{k.perplexity:.4f}", floors[0], f"{k.bits_per_plan:.2f}", floors[1]]
        table.add_row(k.model, k.suite, *cells, percent(k.choices_right, k.choices), kinds)
    return table


def ordered(values: Iterable[_T]) -> list[_T]:
    """The distinct values in order of first appearance."""
    return list(dict.fromkeys(values))
