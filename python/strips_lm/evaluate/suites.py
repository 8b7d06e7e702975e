"""What there is to evaluate on: a suite's prompts, each with its own PDDL problem, read from a data set's folder.

Prompts that occur more than once (the same problem with another of its plans) are tried once. No torch here.
"""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pyarrow.parquet as pq

from strips_lm import _native
from strips_lm.config import ConfigError
from strips_lm.config.names import suggestion
from strips_lm.folders import one_data_set

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

COLUMNS = (
    *("prompt", "completion", "negative", "negative_kind", "plan", "problem_id"),
    *("names", "words", "optimal_steps", "plan_count", "index", "template"),
)


@dataclass(frozen=True, slots=True)
class Item:
    """One record of a suite."""

    prompt: str
    completion: str
    negative: str
    negative_kind: str
    plan: str
    problem_id: int
    names: list[str]
    words: list[str]
    optimal_steps: int
    """Of the shortest plans; -1 where that is not known."""
    plan_count: int
    index: int = -1
    """The record's index in the data set; -1 for what is no record."""
    template: str = ""
    """The template of its problem, `random` for a random one; empty for what is no record."""


class DataFolder:
    """A data set's folder: its domain, its lexicon, its problems, its suites."""

    def __init__(self, path: str | Path) -> None:
        """Open it.

        Raises:
            ConfigError: it is not a finished data set, or several.
        """
        self.path = one_data_set(Path(path))
        if not (self.path / "manifest.json").is_file():
            raise ConfigError(f"{path}: no finished data set here\nhint: strips-lm gen-data --out {path}")
        self.domain_text = (self.path / "domain.pddl").read_text(encoding="utf-8")
        self.domain = _native.Domain.parse(self.domain_text, str(self.path / "domain.pddl"))
        self.actions = [name for name, _ in self.domain.actions]
        self.predicates = [name for name, _ in self.domain.predicates]
        self.problems: list[str] = pq.read_table(self.path / "problems.parquet", columns=["problem"])[
            "problem"
        ].to_pylist()
        self.synonyms = read_synonyms(self.path / "lexicon.toml")
        self._tasks: dict[int, _native.Task] = {}

    def suites(self) -> list[str]:
        """The splits that are there, by name."""
        files = (self.path / "data").glob("*.parquet")
        return sorted({file.name.rsplit("-", 3)[0].replace("_", "-") for file in files})

    def items(self, suite: str, limit: int = 0, *, distinct: bool = True) -> list[Item]:
        """The first `limit` records of a suite (0 is all), each prompt once where `distinct`.

        Raises:
            ConfigError: there is no such suite.
        """
        files = sorted((self.path / "data").glob(f"{suite.replace('-', '_')}-*.parquet"))
        if not files:
            raise ConfigError(f"{self.path}: no suite `{suite}`{suggestion(suite, self.suites())}")
        found: list[Item] = []
        seen: set[str] = set()
        for item in _read(files):
            if distinct and item.prompt in seen:
                continue
            seen.add(item.prompt)
            found.append(item)
            if len(found) == limit:
                break
        return found

    def problem(self, item: Item) -> str:
        """The record's own PDDL problem, with its names."""
        problem = _native.Problem.parse(self.problems[item.problem_id], self.domain)
        return problem.rename(item.names).to_pddl()

    def task(self, item: Item) -> _native.Task:
        """The task that the record shares with others of its problem; its objects have the problem's names."""
        found = self._tasks.get(item.problem_id)
        if found is None:
            problem = _native.Problem.parse(self.problems[item.problem_id], self.domain)
            found = self._tasks[item.problem_id] = _native.Task(self.domain, problem)
        return found

    def words(self, item: Item) -> dict[str, str]:
        """Every word that may stand for an action or a predicate in the record, its own words first of all."""
        return {
            **self.synonyms,
            **{name: name for name in self.actions},
            **dict(zip(item.words, [*self.actions, *self.predicates], strict=False)),
        }


def read_synonyms(lexicon: Path) -> dict[str, str]:
    """Each word of a lexicon with its action or predicate; nothing where there is no lexicon."""
    if not lexicon.is_file():
        return {}
    table: dict[str, Any] = tomllib.loads(lexicon.read_text(encoding="utf-8"))
    named = [(name, lists) for section in ("predicates", "actions") for name, lists in table.get(section, {}).items()]
    return {word: name for name, lists in named for words in lists.values() for word in words}


def _read(files: Sequence[Path]) -> Iterator[Item]:
    for path in files:
        with pq.ParquetFile(path) as file:
            for batch in file.iter_batches(batch_size=1024, columns=list(COLUMNS)):
                columns = batch.to_pydict()
                columns["plan_count"] = [int(count) for count in columns["plan_count"]]
                columns["optimal_steps"] = [-1 if steps is None else steps for steps in columns["optimal_steps"]]
                rows: Iterator[Any] = zip(*(columns[name] for name in COLUMNS), strict=True)
                yield from (Item(*row) for row in rows)
