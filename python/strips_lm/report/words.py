"""Atoms and verdicts as HTML."""

from __future__ import annotations

from html import escape
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable

    from strips_lm.evaluate.results import Output


def atoms_line(atoms: Iterable[str]) -> str:
    """Atoms in a row that breaks between them only."""
    return " ".join(f'<span class="atom">{escape(atom)}</span>' for atom in atoms)


def verdict_line(output: Output) -> str:
    """What the oracle says of an output."""
    if output.verdict == "valid" and output.finished:
        return '<span class="good">✓ valid</span> reaches the goal'
    reason = output.reason if output.verdict != "valid" else "the text does not end"
    name = output.verdict.replace("_", " ") if output.verdict != "valid" else "unfinished"
    return f'<span class="bad">✗ {escape(name)}</span> {escape(reason)}'
