"""Table 1 for a terminal: perplexity, multiple-choice accuracy and the share of valid plans, per model and suite."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeVar

from rich.table import Table

from strips_lm.evaluate.statistics import rerank_gaps

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from strips_lm.evaluate.results import Likelihood, Results, Score

_T = TypeVar("_T")

SPEEDS = ("prompts/s", "tokens/s")

RANDOM = "random"
"""What the records of random problems have for a template."""


def percent(part: float, whole: float) -> str:
    """A share in per cent with one decimal, or a dash of nothing."""
    return f"{100 * part / whole:.1f}" if whole else "–"


def interval(score: Score) -> str:
    """Per cent valid and its 95 % interval."""
    return f"{100 * score.share:.1f} [{100 * score.valid_low:.1f}, {100 * score.valid_high:.1f}]"


def place(suite: str) -> tuple[str, str]:
    """The domain, where the suite is of a mixture's data set, and the suite's own name."""
    domain, _, name = suite.rpartition("/")
    return domain, name


def summary(results: Results) -> Table:
    """The report's Table 1: one line a model (and domain), one column a suite, free greedy decoding first."""
    table = Table(title="Table 1", caption=_caption(results), caption_justify="left")
    suites = ordered(place(score.suite)[1] for score in results.scores)
    lines = list(_lines(results))
    mixed = any(domain for _, _, domain in lines)
    for name in ("model", *(["domain"] if mixed else []), "decode"):
        table.add_column(name, no_wrap=True)
    for name in ("perplexity", "choice %"):
        table.add_column(name, justify="right", no_wrap=True)
    for suite in suites:
        table.add_column(suite, justify="right")
    for model, decode, domain in lines:
        about = [model, domain] if mixed else [model]
        table.add_row(*about, *_cells(results, model, decode, [f"{domain}/{s}".lstrip("/") for s in suites]))
    return table


def _caption(results: Results) -> str:
    prompts = _spread({score.prompts for score in results.scores})
    different = {score.problems for score in results.scores if score.problems is not None}
    problems = f" ({_spread(different)} problems)" if any(score.repeats for score in results.scores) else ""
    counts = f"{prompts} prompts{problems} a suite"
    return f"% valid plans of {counts}, checked by the oracle; * the oracle took part in decoding"


def _spread(counts: set[int]) -> str:
    """`1000`, or `200 to 1000`."""
    return " to ".join(map(str, sorted({min(counts), max(counts)}))) if counts else ""


def _lines(results: Results) -> Iterator[tuple[str, str, str]]:
    """(model, decode, domain) of each line, the ones without the oracle's help first."""
    ranked = sorted(results.scores, key=lambda s: s.oracle_helps)
    yield from ordered((s.model, s.decode, place(s.suite)[0]) for s in ranked)


def _cells(results: Results, model: str, decode: str, suites: list[str]) -> list[str]:
    scores = {s.suite: s for s in results.scores if (s.model, s.decode) == (model, decode)}
    mark = "*" if any(s.oracle_helps for s in scores.values()) else ""
    return [
        decode + mark,
        *likelihood_cells([k for k in results.likelihoods if k.model == model and k.suite in suites]),
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
    caption = (
        "prompts by verdict; states: share of right ones; traces: valid plans with every state right, of all prompts"
    )
    table = Table(title="What the oracle says", caption=caption)
    for name in ("model", "suite", "decode"):
        table.add_column(name, no_wrap=True)
    for name in (*names, "unfinished", "executable %", "optimal %", "surplus", "states", "traces %", *SPEEDS):
        table.add_column(name.replace("_", " "), justify="right")
    for s in results.scores:
        counts = [str(s.verdicts.get(name, 0)) for name in names]
        surplus = "–" if s.surplus_mean is None else f"{s.surplus_mean:.2f}"
        executable = percent(s.executable_share or 0.0, 1)
        rates = [executable, percent(s.optimal, s.comparable), surplus, percent(s.states_right, s.states)]
        rates.append(percent(s.traces_right, s.prompts))
        speed = [f"{s.prompts_per_second:.0f}", f"{s.tokens_per_second:.0f}"]
        table.add_row(s.model, s.suite, s.decode, *counts, str(s.unfinished), *rates, *speed)
    return table


def tables(results: Results) -> list[Table]:
    """Everything that was found, Table 1 last; no table is empty."""
    every = (failures, likelihoods, invariances, gaps, kinds, summary)
    return [table for table in (make(results) for make in every) if table.row_count]


def invariances(results: Results) -> Table:
    """How often the plan stays the same when the problem's objects get other names."""
    table = Table(title="The same problems under other names", caption="same: % of renamings with the same plan")
    for name in ("model", "suite", "problems", "renamings", "same %", "always the same %"):
        table.add_column(name, justify="left" if name in {"model", "suite"} else "right", no_wrap=True)
    for k in results.invariances:
        shares = percent(k.same, k.renamed), percent(k.always, k.problems)
        table.add_row(k.model, k.suite, str(k.problems), str(k.renamed), *shares)
    return table


def kinds(results: Results) -> Table:
    """The share of valid plans on the templates' problems and on random ones, where a suite has both."""
    caption = (
        "a suite mixes templates' problems with random ones; a template's are all alike but for names and positions"
    )
    table = Table(title="By kind of problem", caption=caption)
    for name in ("model", "suite", "decode", "templates %", "of", "random %", "of"):
        table.add_column(name, justify="left" if name in {"model", "suite", "decode"} else "right", no_wrap=True)
    for s in results.scores:
        drawn = s.by_template.get(RANDOM)
        told = [sum(counts) for counts in zip(*(c for t, c in s.by_template.items() if t != RANDOM), strict=True)]
        if drawn and told:
            cells = [percent(*told), str(told[1]), percent(*drawn), str(drawn[1])]
            table.add_row(s.model, s.suite, s.decode, *cells)
    return table


def gaps(results: Results) -> Table:
    """How much of the way from no choice to the oracle's choice each way of choosing among samples goes."""
    caption = (
        "from: greedy where it was tried, else the first sample; closed: share of the way from there to the oracle"
    )
    table = Table(title="Choosing among samples", caption=caption)
    for name in ("model", "suite", "choice", "from", "valid %", "by oracle", "closed %"):
        table.add_column(name, justify="left" if name in {"model", "suite", "choice"} else "right", no_wrap=True)
    for gap in rerank_gaps(results.scores):
        start, reached, most = (f"{100 * share:.1f}" for share in (gap.start, gap.reached, gap.most))
        closed = "–" if gap.closed is None else f"{100 * gap.closed:.0f}"
        table.add_row(gap.model, gap.suite, gap.choice, start, reached, most, closed)
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
