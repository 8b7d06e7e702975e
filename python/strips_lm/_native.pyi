"""The oracle, in Rust.

Texts in, plans, counts and verdicts out. Every call that may be long leaves the interpreter free and answers Ctrl-C.
"""

from collections.abc import Iterator, Sequence
from typing import Literal, final, overload

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "DataError",
    "Domain",
    "LimitError",
    "PddlError",
    "PlanIterator",
    "PlanSet",
    "Plans",
    "Problem",
    "Task",
    "__version__",
]
__version__: str

_Semantics = Literal["first-goal", "any", "simple"]
_Plan = tuple[str, ...]
"""Operator names, such as `("(pick cup)", "(place cup shelf)")`."""

class PddlError(ValueError):
    """A PDDL text that is wrong; `str` shows the line with a caret."""

    kind: str
    file: str
    line: int
    column: int
    message: str

class LimitError(RuntimeError):
    """A budget was spent before the work was done."""

    kind: str

class DataError(ValueError):
    """A mistake in a template, lexicon or data file; `str` has its file, line and column."""

@final
class Domain:
    """A planning domain, every name resolved and every type checked."""

    @staticmethod
    def parse(text: str | bytes, file: str = "<domain>") -> Domain:
        """Parses a PDDL domain; `file` is what messages call it.

        Raises:
            PddlError: the text is no domain of the supported language.
        """
    @property
    def name(self) -> str:
        """The domain's name."""
    @property
    def types(self) -> list[tuple[str, list[str]]]:
        """Every type with its direct supertypes; `object` comes first."""
    @property
    def constants(self) -> list[tuple[str, str]]:
        """Every constant with its type."""
    @property
    def predicates(self) -> list[tuple[str, list[str]]]:
        """Every predicate with its parameters' types."""
    @property
    def actions(self) -> list[tuple[str, list[str]]]:
        """Every action with its parameters' types."""
    @property
    def warnings(self) -> list[str]:
        """What was accepted although the standard forbids it, a line each."""
    def to_pddl(self) -> str:
        """The domain as PDDL; parsing it gives the same domain again."""

@final
class Problem:
    """A problem of a domain."""

    @staticmethod
    def parse(text: str | bytes, domain: Domain, file: str = "<problem>") -> Problem:
        """Parses a PDDL problem of `domain`; `file` is what messages call it.

        Raises:
            PddlError: the text is no problem of the domain.
        """
    @property
    def name(self) -> str:
        """The problem's name."""
    @property
    def objects(self) -> list[tuple[str, str]]:
        """Every object with its type: constants first, then the problem's own."""
    @property
    def warnings(self) -> list[str]:
        """What was accepted although the standard forbids it, a line each."""
    def to_pddl(self) -> str:
        """The problem as PDDL; parsing it gives the same problem again."""
    def rename(self, names: Sequence[str]) -> Problem:
        """The same problem with its objects called `names`.

        Raises:
            ValueError: the names are not all different, not one an object, or change the domain's own.
        """

@final
class Task:
    """A problem grounded to facts and operators; nothing that can ever be applied is left out."""

    def __new__(
        cls,
        domain: Domain,
        problem: Problem,
        *,
        max_operators: int | None = None,
        max_facts: int | None = None,
        max_bytes: int | None = None,
        time_limit: float | None = None,
    ) -> Task:
        """Grounds a problem.

        Raises:
            LimitError: more operators or facts than allowed, more memory or more seconds.
        """
    @property
    def num_facts(self) -> int:
        """How many facts can differ between reachable states."""
    @property
    def num_operators(self) -> int:
        """How many operators there are."""
    def operator_name(self, operator: int) -> str:
        """An operator's name, such as `(pick cup)`."""
    def plan_set(
        self,
        max_steps: int,
        semantics: _Semantics = "first-goal",
        *,
        max_states: int | None = None,
        max_bytes: int | None = None,
        time_limit: float | None = None,
    ) -> PlanSet:
        """All plans of at most `max_steps` steps.

        Raises:
            LimitError: more states than allowed, more memory or more seconds.
        """

@final
class PlanSet:
    """All plans of at most `max_steps` steps, shorter ones first, then in the order of their operators.

    A sequence of plans: `plans[i]` finds one by its rank in time linear in its length, a slice gives them as arrays,
    iteration keeps a chunk at a time.
    """

    @property
    def max_steps(self) -> int:
        """The longest plan's steps."""
    @property
    def semantics(self) -> _Semantics:
        """Which sequences count as plans."""
    def count(self) -> int:
        """How many plans there are; exact at any size, where `len` is limited to what an index can hold."""
    def counts(self) -> list[int]:
        """How many plans there are of each length, from 0 to `max_steps`."""
    def __len__(self) -> int: ...
    def __bool__(self) -> bool: ...
    @overload
    def __getitem__(self, index: int, /) -> _Plan: ...
    @overload
    def __getitem__(self, index: slice, /) -> Plans: ...
    def __iter__(self) -> Iterator[_Plan]: ...
    def __contains__(self, plan: Sequence[str | int], /) -> bool: ...
    def rank(self, plan: Sequence[str | int]) -> int | None:
        """The place of a plan (names or ids of its operators) in the set, or `None` where it is not in it."""
    def sample(self, k: int, seed: int, replace: bool = True) -> Plans:
        """Draws `k` plans uniformly; without `replace`, no plan twice. The same seed gives the same plans.

        Raises:
            ValueError: there are too few plans.
        """
    def shortest(self) -> _Plan | None:
        """The first of the shortest plans, or `None` where there is no plan."""
    def shortest_length(self) -> int | None:
        """The steps of a shortest plan, or `None` where there is no plan."""
    def entropy(self) -> float:
        """The entropy, in nats, of a plan drawn uniformly."""
    def next_operators(self, prefix: Sequence[str | int]) -> list[tuple[int | None, int]]:
        """What may follow a prefix of operators: (operator id, number of plans that go on so); the id `None` is the end."""
    def text(self, start: int | None = None, stop: int | None = None) -> str:
        """The plans from `start` to `stop` in IPC form, a block each, blocks separated by a blank line."""

@final
class PlanIterator:
    """Plans one after another; holds a chunk of them at a time."""

    def __iter__(self) -> PlanIterator: ...
    def __next__(self) -> _Plan: ...

@final
class Plans:
    """Some plans, as two flat arrays: plan `i` has the operators `operators[offsets[i]:offsets[i + 1]]`."""

    @property
    def operators(self) -> NDArray[np.uint32]:
        """Operator ids, plan after plan; read-only."""
    @property
    def offsets(self) -> NDArray[np.int64]:
        """Where each plan begins, and where the last one ends; read-only."""
    def __len__(self) -> int: ...
    def __getitem__(self, index: int, /) -> _Plan: ...
    def text(self) -> str:
        """The plans in IPC form, a block each, blocks separated by a blank line."""
