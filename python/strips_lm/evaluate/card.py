"""A checkpoint's scores in its own card: as `model-index` metadata, which hubs read, and as a table for people.

The card is rewritten whole each time, so an evaluation replaces the one before; a checkpoint that is written anew has
none. Only what was decoded without the oracle's help is metadata; the table marks the rest.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

from strips_lm.evaluate.table import interval, ordered
from strips_lm.model import checkpoint_folder

if TYPE_CHECKING:
    from strips_lm.evaluate.results import Model, Results, Score

CARD = "README.md"


def write_cards(results: Results) -> None:
    """Puts each model's scores into the card of its checkpoint; one without a card is left alone."""
    for model in results.models:
        path = checkpoint_folder(model.path) / CARD
        if path.is_file():
            partial = path.with_name(f".{CARD}.partial")
            partial.write_text(with_scores(path.read_text(encoding="utf-8"), results, model), encoding="utf-8")
            partial.replace(path)


def with_scores(card: str, results: Results, model: Model) -> str:
    """The card with a model's scores in place of those that it had."""
    scores = [score for score in results.scores if score.model == model.name]
    _, about, body = card.split("---\n", 2)
    about = about.partition("model-index:\n")[0] + _metadata(results, model, scores)
    body, _, limits = body.partition("## Limits\n")
    body = body.partition("## Results\n")[0] + _section(results, scores)
    return f"---\n{about}---\n{body}## Limits\n{limits}"


def _metadata(results: Results, model: Model, scores: list[Score]) -> str:
    """The `model-index` of a model card; values are per cent."""
    free = [score for score in scores if not score.oracle_helps]
    if not free:
        return ""
    lines = ["model-index:", f"- name: {json.dumps(model.name)}", "  results:"]
    for score in free:
        suite = json.dumps(f"{Path(results.data).name}: {score.suite}")
        lines += [
            "  - task:",
            "      type: text-generation",
            "      name: planning",
            "    dataset:",
            "      type: strips-lm",
            f"      name: {suite}",
            "    metrics:",
            "    - type: valid-plans",
            f"      value: {100 * score.share:.1f}",
            f"      name: {json.dumps(f'% valid plans of {score.prompts}, {score.decode}')}",
        ]
    return "\n".join(lines) + "\n"


def _prompts(score: Score) -> str:
    """How many prompts, and of how many problems where these are fewer."""
    return f"{score.prompts} ({score.problems} problems)" if score.repeats else str(score.prompts)


def _section(results: Results, scores: list[Score]) -> str:
    """A line for each suite, a column for each way of decoding; nothing without scores."""
    if not scores:
        return ""
    decodes = ordered(score.decode for score in scores)
    helped = {score.decode for score in scores if score.oracle_helps}
    heads = " | ".join(f"{decode} *" if decode in helped else decode for decode in decodes)
    found = {(score.suite, score.decode): interval(score) for score in scores}
    prompts = {score.suite: _prompts(score) for score in scores}
    rows = [
        f"| {suite} | {count} | {' | '.join(found.get((suite, decode), '–') for decode in decodes)} |"
        for suite, count in prompts.items()
    ]
    data = Path(results.data).name
    note = "; * the oracle took part in decoding" if helped else ""
    intro = (
        f"% valid plans and 95 % intervals on `{data}`, {results.created[:10]}; "
        f"the oracle checked every plan against its prompt's own PDDL problem{note}."
    )
    table = [f"| suite | prompts | {heads} |", f"|---|---|{'---|' * len(decodes)}", *rows]
    return "\n".join(["## Results", "", intro, "", *table, "", ""])
