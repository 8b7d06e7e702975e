"""What must not change the set of plans: other names, another order, an object out of reach, a type split in two."""

from __future__ import annotations

import re
from dataclasses import replace

import pytest
from hypothesis import HealthCheck, given, settings

from naive import OBJECTS, TYPES, NaiveTask, tasks
from strips_lm import Domain, Problem, Task

FEW = settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large])
SEMANTICS = pytest.mark.parametrize("semantics", ["first-goal", "any", "simple"])
NAMES = {"a": "zinc", "b": "a", "c": "b", "go": "do", "do": "go", "flag": "on", "open": "flag", "on": "open"}
"""A permutation and more: every order by name changes."""


def plans(domain_text: str, problem_text: str, semantics: str) -> set[tuple[str, ...]]:
    domain = Domain.parse(domain_text)
    return set(Task(domain, Problem.parse(problem_text, domain)).plan_set(3, semantics))


def renamed(text: str) -> str:
    """The text with every whole word of `NAMES` exchanged."""
    return re.sub(r"(?<![\w?:-])[a-z]+(?![\w-])", lambda word: NAMES.get(word[0], word[0]), text)


def reordered(naive: NaiveTask) -> NaiveTask:
    """The same task, everything written the other way round."""
    actions = [
        replace(action, precondition=action.precondition[::-1], effects=action.effects[::-1])
        for action in naive.actions[::-1]
    ]
    return replace(naive, actions=tuple(actions), goal=naive.goal[::-1])


@SEMANTICS
@FEW
@given(naive=tasks())
def test_names_mean_nothing(semantics, naive):
    expected = plans(naive.domain(), naive.problem(), semantics)
    found = plans(renamed(naive.domain()), renamed(naive.problem()), semantics)
    assert found == {tuple(map(renamed, plan)) for plan in expected}


@SEMANTICS
@FEW
@given(naive=tasks())
def test_order_means_nothing(semantics, naive):
    other = reordered(naive)
    objects = [f"{name} - {kind}" for name, kind in OBJECTS.items()]
    problem = other.problem().replace(" ".join(objects), " ".join(objects[::-1]))
    assert problem != naive.problem()
    assert plans(other.domain(), problem, semantics) == plans(naive.domain(), naive.problem(), semantics)


@SEMANTICS
@FEW
@given(naive=tasks())
def test_an_object_that_nothing_takes_changes_nothing(semantics, naive):
    domain = naive.domain().replace("(:types ", "(:types spare - object ")
    problem = naive.problem().replace("(:objects ", "(:objects moon - spare ")
    assert plans(domain, problem, semantics) == plans(naive.domain(), naive.problem(), semantics)


@SEMANTICS
@FEW
@given(naive=tasks())
def test_a_type_split_in_two_changes_nothing(semantics, naive):
    halves = " ".join(f"{kind}-one {kind}-two - {kind}" for kind in TYPES)
    domain = naive.domain().replace("(:types ", f"(:types {halves} ")
    problem = naive.problem()
    for half, (name, kind) in zip(["one", "two", "one"], OBJECTS.items(), strict=True):
        problem = problem.replace(f"{name} - {kind}", f"{name} - {kind}-{half}")
    assert problem != naive.problem()
    assert plans(domain, problem, semantics) == plans(naive.domain(), naive.problem(), semantics)
