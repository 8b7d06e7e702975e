"""Misspelt names: the error that configuration raises, and the nearest name that exists."""

from __future__ import annotations

import difflib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable


class ConfigError(ValueError):
    """A configuration that cannot be: an unknown key, a value of the wrong type, a contradiction."""


def suggestion(name: str, known: Iterable[str]) -> str:
    r"""A line that suggests the known name nearest to `name`, or nothing.

    >>> suggestion("sede", ["seed", "pairs"])
    '\nhint: did you mean `seed`?'
    """
    near = difflib.get_close_matches(name, list(known), n=1, cutoff=0.5)
    return f"\nhint: did you mean `{near[0]}`?" if near else ""
