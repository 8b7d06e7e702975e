"""What the models wrote, side by side (Figure 4): actions and the changes between states are marked."""

from __future__ import annotations

from html import escape
from typing import TYPE_CHECKING

from strips_lm.report.figures import free_scores
from strips_lm.report.words import atoms_line, verdict_line
from strips_lm.trace import trace

if TYPE_CHECKING:
    from strips_lm.evaluate.results import Example, Output, Results
    from strips_lm.trace import Step

RAW = 3000
"""Characters of a text that are shown as it is."""

STEPS = 30
"""Steps of a text that are shown; a model that has learnt nothing may write hundreds."""


def examples(results: Results, count: int = 3) -> str:
    """The prompts that tell the models apart best come first: those with the most different verdicts."""
    decode = free_scores(results)[0].decode
    ranked = sorted(results.examples, key=lambda e: (-_contrast(e, decode), e.suite != "unseen-objects"))
    return "".join(_example(found, decode) for found in ranked[:count])


def _contrast(found: Example, decode: str) -> int:
    return len({output.verdict for output in found.outputs if output.decode == decode})


def _example(found: Example, decode: str) -> str:
    """One prompt and the outputs for it; those of other ways of decoding are folded away."""
    read = trace(found.prompt, "")
    first = [o for o in found.outputs if o.decode == decode]
    others = [o for o in found.outputs if o.decode != decode]
    columns = "".join(_output(found, output) for output in first)
    more = "".join(_output(found, output) for output in others)
    fold = f'<details><summary>decoded in other ways</summary><div class="outputs">{more}</div></details>'
    return (
        f"<h3>{escape(found.suite)}, prompt {found.index}</h3>"
        f'<dl class="prompt"><dt>goal</dt><dd>{atoms_line(read.goal)}</dd>'
        f"<dt>start</dt><dd>{atoms_line(read.initial)}</dd></dl>"
        f'<div class="outputs">{columns}</div>{fold if more else ""}'
    )


def _output(found: Example, output: Output) -> str:
    """One column: the steps, the verdict, the text as it is."""
    read = trace(found.prompt, output.text).steps
    steps = "".join(_step(step, number, output.step) for number, step in enumerate(read[:STEPS], 1))
    body = f'<ol class="trace">{steps}</ol>' if steps else '<p class="faint">No step can be read.</p>'
    body += f'<p class="faint">… and {len(read) - STEPS} more steps</p>' if len(read) > STEPS else ""
    text = escape(output.text[:RAW]) + (" …" if len(output.text) > RAW else "")
    return (
        f'<div class="output"><h4>{escape(output.model)} <small>{escape(output.decode)}</small></h4>{body}'
        f"<p>{verdict_line(output)}</p><details><summary>the text</summary><pre>{text}</pre></details></div>"
    )


def _step(step: Step, number: int, at: int | None) -> str:
    kind = "" if at is None or number < at else "wrong" if number == at else "after"
    return f'<li class="{kind}"><mark>{escape(step.operator)}</mark><div>{_state(step)}</div></li>'


def _state(step: Step) -> str:
    """New atoms marked, lost ones struck out, the others faint."""
    if step.state is None:
        return '<span class="faint">no state</span>'
    parts = [
        f'<span class="atom new">{escape(atom)}</span>'
        if atom in step.added
        else f'<span class="atom">{escape(atom)}</span>'
        for atom in sorted(step.state, key=lambda atom: atom not in step.added)
    ]
    parts[len(step.added) : len(step.added)] = [f'<del class="atom">{escape(atom)}</del>' for atom in step.removed]
    return " ".join(parts)
