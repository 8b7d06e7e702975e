"""The report's sections as HTML, each from the results alone. It draws nothing and reads no file."""

from __future__ import annotations

import re
from html import escape
from typing import TYPE_CHECKING

from strips_lm.evaluate.table import ordered, percent

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from strips_lm.evaluate.results import Example, Likelihood, Output, Results, Score


def cards(results: Results) -> str:
    """The headline numbers: each model's share of valid plans on names that it has not seen, or on its first suite."""
    wanted = "unseen-objects" if any(s.suite == "unseen-objects" for s in results.scores) else results.scores[0].suite
    found = [s for s in results.scores if s.suite == wanted and s.decode == results.scores[0].decode]
    inner = "".join(
        f'<div class="card"><b>{100 * s.share:.1f} %</b>{escape(s.model)}<br>'
        f"<small>valid on {escape(s.suite)}, {escape(s.decode)}</small></div>"
        for s in found
    )
    return f'<div class="cards">{inner}</div>'


def table(results: Results) -> str:
    """Table 1: a line for each model and way of decoding, a column for each suite."""
    suites = ordered(s.suite for s in results.scores)
    heads = ["model", "decode", "perplexity", "choice %", *suites]
    ranked = sorted(results.scores, key=lambda s: s.oracle_helps)
    rows = [_row(results, *line, suites) for line in ordered((s.model, s.decode) for s in ranked)]
    head = "".join(f"<th>{escape(name)}</th>" for name in heads)
    return f'<div class="wide"><table><thead><tr>{head}</tr></thead><tbody>{"".join(rows)}</tbody></table></div>'


def _row(results: Results, model: str, decode: str, suites: Sequence[str]) -> str:
    scores = {s.suite: s for s in results.scores if (s.model, s.decode) == (model, decode)}
    helped = any(s.oracle_helps for s in scores.values())
    cells = [f"<td>{escape(model)}</td>", f'<td class="text">{escape(decode)}{" *" if helped else ""}</td>']
    cells += _likelihood_cells([k for k in results.likelihoods if k.model == model])
    cells += [_share_cell(scores.get(suite), results) for suite in suites]
    return f"<tr{' class=helped' if helped else ''}>{''.join(cells)}</tr>"


def _likelihood_cells(found: Sequence[Likelihood]) -> list[str]:
    """Perplexity and choice on the first suite measured."""
    if not found:
        return ["<td>–</td>", "<td>–</td>"]
    first = found[0]
    floor = f"floor {first.floor:.4f}" if first.floor else ""
    choice = percent(first.choices_right, first.choices)
    return [f"<td>{first.perplexity:.4f}<small>{floor}</small></td>", f"<td>{choice}</td>"]


def _share_cell(score: Score | None, results: Results) -> str:
    if score is None:
        return "<td>–</td>"
    free = [s.share for s in results.scores if s.suite == score.suite and not s.oracle_helps]
    best = " class=best" if not score.oracle_helps and score.share == max(free) else ""
    spread = f"{100 * score.valid_low:.1f}–{100 * score.valid_high:.1f}"
    return f"<td{best}>{100 * score.share:.1f}<small>{spread}</small></td>"


def details(results: Results) -> str:
    """Every score in full, one line each."""
    heads = ["model", "suite", "decode", "prompts", "valid %", "optimal %", "surplus", "executable %", "states %"]
    heads += ["traces %", "unfinished", "malformed", "prompts/s", "tokens/s"]
    return _plain_table(heads, [_detail(s) for s in results.scores])


def _detail(s: Score) -> list[str]:
    surplus = f"{s.surplus_mean:.2f}" if s.surplus_mean is not None else "–"
    executable = f"{100 * s.executable_share:.1f}" if s.executable_share is not None else "–"
    counts = [str(s.unfinished), str(s.malformed), f"{s.prompts_per_second:.0f}", f"{s.tokens_per_second:.0f}"]
    shares = [percent(s.valid, s.prompts), percent(s.optimal, s.valid), surplus, executable]
    states = [percent(s.states_right, s.states), percent(s.traces_right, s.prompts)]
    return [s.model, s.suite, s.decode, str(s.prompts), *shares, *states, *counts]


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
    return f'<div class="wide"><table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div>'


def example(found: Example) -> str:
    """One prompt and the models' outputs side by side, with what each state changed marked (Figure 4)."""
    prompt = re.sub(r" (?=<[A-Z|]+)", "\n", found.prompt)
    outputs = "".join(_output(found, output) for output in found.outputs)
    return (
        f"<h3>{escape(found.suite)}, prompt {found.index}</h3><pre>{escape(prompt)}</pre>"
        f'<div class="outputs">{outputs}</div>'
    )


def _output(found: Example, output: Output) -> str:
    if output.verdict == "valid" and output.finished:
        verdict = '<span class="good">valid: reaches the goal</span>'
    else:
        reason = output.reason if output.verdict != "valid" else "the text does not end"
        verdict = f'<span class="bad">{escape(output.verdict.replace("_", " "))}</span> {escape(reason)}'
    body = _marked(found.prompt, output.text)
    title = f"{escape(output.model)} <small>{escape(output.decode)}</small>"
    return f'<div class="output"><h3>{title}</h3><pre>{body}</pre><p>{verdict}</p></div>'


def _marked(prompt: str, text: str) -> str:
    """The completion, one segment a line, with actions and the atoms that are new in a state marked."""
    before = _atoms(prompt.rsplit("<INIT>", 1)[-1].split("<", 1)[0])
    lines = []
    for segment in re.split(r"(?=<ACTION>|<STATE>|<\|endoftext\|>)", text[:6000]):
        if segment.startswith("<STATE>"):
            atoms = _atoms(segment.removeprefix("<STATE>"))
            lines.append("&lt;STATE&gt; " + ", ".join(_mark(a) if a not in before else escape(a) for a in atoms))
            before = atoms
        elif segment.startswith("<ACTION>"):
            lines.append("&lt;ACTION&gt; " + _mark(segment.removeprefix("<ACTION>").strip()))
        elif segment.strip():
            lines.append(escape(segment.strip()))
    return "\n".join(lines)


def _atoms(text: str) -> list[str]:
    return [atom.strip() for atom in re.split(r",\s*(?![^()]*\))", text) if atom.strip()]


def _mark(text: str) -> str:
    return f"<mark>{escape(text)}</mark>"
