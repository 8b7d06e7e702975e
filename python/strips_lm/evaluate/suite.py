"""A suite ready to be tried: prompts, PDDL problems, words and tasks, made once for all models."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from strips_lm import _native
from strips_lm.config import ConfigError
from strips_lm.evaluate.suites import DataFolder, Item
from strips_lm.fallback import shortest
from strips_lm.guide import Tasks

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from strips_lm._native import Judgement

SECONDS = 10.0
"""What finding the shortest plan of a user's own problem may take; without one, nothing is said of optimality."""


@dataclass(slots=True)
class Suite:
    """What a suite's prompts are, and what the oracle needs to judge and to guide their answers."""

    name: str
    items: list[Item]
    problems: list[str]
    words: list[dict[str, str]]
    task: Callable[[int], _native.Task]
    """The task of the prompt of a number."""
    of_records: bool = True
    """Whether the prompts have completions and negatives to measure likelihoods on."""
    _judge: _native.Judge | None = None
    """The problems, ready to judge texts against."""

    @classmethod
    def open(cls, data: DataFolder, name: str, limit: int) -> Suite:
        """The first `limit` distinct prompts of a data set's suite."""
        items = data.items(name, limit)
        problems, words = [data.problem(i) for i in items], [data.words(i) for i in items]
        return cls(name, items, problems, words, lambda number: data.task(items[number]))

    @classmethod
    def of_problems(cls, data: DataFolder, folder: str, limit: int) -> Suite:
        """The first `limit` PDDL problems of a folder, by name; `domain.pddl` is none of them.

        Raises:
            ConfigError: there are none.
            PddlError: one is no problem of the data set's domain.
        """
        files = sorted(path for path in Path(folder).glob("*.pddl") if path.name != "domain.pddl")
        if not files:
            raise ConfigError(f"{folder}: no PDDL problems here (*.pddl)")
        read = [_native.Problem.parse(path.read_bytes(), data.domain, str(path)) for path in files[: limit or None]]
        tasks = [_native.Task(data.domain, problem) for problem in read]
        items = [own_item(data, problem, task) for problem, task in zip(read, tasks, strict=True)]
        words = [data.words(item) for item in items]
        name = Path(folder).resolve().name
        return cls(name, items, [p.to_pddl() for p in read], words, tasks.__getitem__, of_records=False)

    def problem_numbers(self) -> list[int]:
        """The number of each prompt's problem: the same for those that differ in nothing but names."""
        return [item.problem_id if self.of_records else number for number, item in enumerate(self.items)]

    def judge(self, domain: _native.Domain, prompts: Sequence[int], texts: Sequence[str]) -> list[Judgement]:
        """The oracle's judgement of each text, written for the prompt of that number."""
        return self.prepare(domain).judge(prompts, texts)

    def prepare(self, domain: _native.Domain) -> _native.Judge:
        """Reads and grounds the problems, which is done once for all texts of all models."""
        if self._judge is None:
            self._judge = _native.Judge(domain, self.problems, self.words)
        return self._judge

    def oracle(self, domain: _native.Domain) -> Tasks:
        """The tasks behind the prompts, grounded when they are asked for."""

        def find(prompts: Sequence[int]) -> tuple[list[_native.Task], list[Sequence[str]]]:
            return [self.task(i) for i in prompts], [self.items[i].names for i in prompts]

        return Tasks(domain, find)


def own_item(data: DataFolder, problem: _native.Problem, task: _native.Task) -> Item:
    """A problem of a user's own as a record without completions."""
    plan = shortest(task, SECONDS)
    return Item(
        prompt=_native.render_prompt(task, "typed", data.actions),
        completion="",
        negative="",
        negative_kind="",
        plan="\n".join(plan or ()),
        problem_id=-1,
        names=[name for name, _ in problem.objects],
        words=data.actions,
        optimal_steps=-1 if plan is None else len(plan),
        plan_count=0,
    )
