"""The report's cards and tables as HTML, each from the results alone. It draws nothing and reads no file."""

from __future__ import annotations

from html import escape
from typing import TYPE_CHECKING

from strips_lm.evaluate.table import ordered, percent, place
from strips_lm.report.figures import free_scores

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from strips_lm.evaluate.results import Likelihood, Results, Score


def cards(results: Results) -> str:
    """The headline numbers: each model's share of valid plans on names that it has not seen, or on its first suite."""
    free = free_scores(results)
    wanted = "unseen-objects" if any(s.suite == "unseen-objects" for s in free) else free[0].suite
    inner = "".join(_card(number, s) for number, s in enumerate(s for s in free if s.suite == wanted))
    return f'<div class="cards">{inner}</div>'


def _card(number: int, s: Score) -> str:
    """One share and its interval, in the colour that the model has in the charts."""
    ends = f"left:{100 * s.valid_low:.1f}%;right:{100 - 100 * s.valid_high:.1f}%"
    return (
        f'<div class="card s{number % 8 + 1}"><b>{100 * s.share:.1f} %</b>{escape(s.model)}'
        f'<div class="interval"><i style="{ends}"></i></div>'
        f"<small>valid on {escape(s.suite)}, {escape(s.decode)}, {s.prompts} prompts</small></div>"
    )


def table(results: Results) -> str:
    """Table 1: a line for each model and way of decoding, a column for each suite; the oracle's help stands apart.

    On a mixture each domain has lines of its own.
    """
    suites = ordered(place(s.suite)[1] for s in results.scores)
    first = free_scores(results)[0].decode
    free = ordered((s.model, s.decode, place(s.suite)[0]) for s in results.scores if not s.oracle_helps)
    free.sort(key=lambda line: line[1] != first)
    helped = ordered((s.model, s.decode, place(s.suite)[0]) for s in results.scores if s.oracle_helps)
    heads = "".join(f"<th>{_breaking(name)}</th>" for name in ["model", *suites, "perplexity", "choice %"])
    body = _lines(results, "Without help", free, suites) + _lines(results, "With the oracle's help", helped, suites)
    return f'<div class="scroll"><table class="results"><thead><tr>{heads}</tr></thead>{body}</table></div>'


def _breaking(name: str) -> str:
    """A column's name that may break after its hyphens."""
    return escape(name).replace("-", "-<wbr>")


def _lines(results: Results, title: str, lines: Sequence[tuple[str, str, str]], suites: Sequence[str]) -> str:
    """A part of the table with its own heading; nothing where it has no line."""
    if not lines:
        return ""
    rows = "".join(_row(results, *line, suites) for line in lines)
    return f'<tbody><tr><th class="part" colspan="{len(suites) + 3}"><span>{title}</span></th></tr>{rows}</tbody>'


def _row(results: Results, model: str, decode: str, domain: str, suites: Sequence[str]) -> str:
    names = [f"{domain}/{suite}".lstrip("/") for suite in suites]
    scores = {s.suite: s for s in results.scores if (s.model, s.decode) == (model, decode)}
    about = f"{domain}, {decode}" if domain else decode
    cells = [f"<td>{escape(model)}<small>{escape(about)}</small></td>"]
    cells += [_share_cell(scores.get(name), results) for name in names]
    cells += _likelihood_cells([k for k in results.likelihoods if k.model == model and k.suite in names])
    return f"<tr>{''.join(cells)}</tr>"


def _likelihood_cells(found: Sequence[Likelihood]) -> list[str]:
    """Perplexity and choice on the first suite measured."""
    if not found:
        return ["<td>–</td>", "<td>–</td>"]
    first = found[0]
    floor = f"floor {first.floor:.4f}" if first.floor else ""
    choice = percent(first.choices_right, first.choices)
    return [f"<td>{first.perplexity:.4f}<small>{floor}</small></td>", f"<td>{choice}</td>"]


def _share_cell(score: Score | None, results: Results) -> str:
    """The share with its interval, on a ground whose strength is the share; the best of its part is bold."""
    if score is None:
        return "<td>–</td>"
    peers = [s.share for s in results.scores if (s.suite, s.oracle_helps) == (score.suite, score.oracle_helps)]
    best = " best" if score.share == max(peers) > 0 else ""
    spread = f"{100 * score.valid_low:.1f}–{100 * score.valid_high:.1f}"
    ground = f"--share:{100 * score.share:.0f}%"
    return f'<td class="share{best}" style="{ground}">{100 * score.share:.1f}<small>{spread}</small></td>'


def details(results: Results) -> str:
    """Every score in full, one line each."""
    heads = ["model", "suite", "decode", "prompts", "problems", "valid %", "optimal %", "surplus"]
    heads += ["executable %", "states %", "traces %", "unfinished", "malformed", "prompts/s", "tokens/s"]
    return _plain_table(heads, [_detail(s) for s in results.scores])


def _detail(s: Score) -> list[str]:
    surplus = f"{s.surplus_mean:.2f}" if s.surplus_mean is not None else "–"
    executable = f"{100 * s.executable_share:.1f}" if s.executable_share is not None else "–"
    counts = [str(s.unfinished), str(s.malformed), f"{s.prompts_per_second:.0f}", f"{s.tokens_per_second:.0f}"]
    shares = [percent(s.valid, s.prompts), percent(s.optimal, s.comparable), surplus, executable]
    states = [percent(s.states_right, s.states), percent(s.traces_right, s.prompts)]
    problems = "–" if s.problems is None else str(s.problems)
    return [s.model, s.suite, s.decode, str(s.prompts), problems, *shares, *states, *counts]


def likelihoods(results: Results) -> str:
    """Perplexities with their floors, and the second head per kind of negative."""
    heads = ["model", "suite", "tokens", "perplexity", "floor", "bits/plan", "its floor", "choice %", "by negative"]
    return _plain_table(heads, [_likelihood(k) for k in results.likelihoods])


def _likelihood(k: Likelihood) -> list[str]:
    kinds = ", ".join(f"{kind} {percent(*found)}" for kind, found in k.by_negative.items())
    floors = [f"{value:.4f}" if value is not None else "–" for value in (k.floor, k.floor_bits_per_plan)]
    numbers = [str(k.tokens), f"{k.perplexity:.4f}", floors[0], f"{k.bits_per_plan:.3f}", floors[1]]
    return [k.model, k.suite, *numbers, percent(k.choices_right, k.choices), kinds]


def _plain_table(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    head = "".join(f"<th>{escape(name)}</th>" for name in heads)
    body = "".join("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in rows)
    return f'<div class="scroll"><table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div>'
