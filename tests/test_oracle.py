"""The oracle as Python sees it: against the naive one on random tasks, and its laws.

`STRIPS_TASKS` says how many random tasks (default 200; .ci/run takes 2,000). A long run:

    STRIPS_TASKS=100000 uv run pytest tests/test_oracle.py -k naive
"""

from __future__ import annotations

import itertools
import math
import os
import signal
import threading
import time

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from naive import NaiveTask, tasks
from strips_lm import Domain, LimitError, PddlError, Problem, Task
from strips_lm._native import OUTCOMES

SEMANTICS = ("first-goal", "any", "simple")
MANY = settings(
    max_examples=int(os.environ.get("STRIPS_TASKS", "200")),
    deadline=None,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large],
)


def grounded(naive: NaiveTask) -> Task:
    domain = Domain.parse(naive.domain())
    return Task(domain, Problem.parse(naive.problem(), domain))


@pytest.fixture
def task(cups) -> Task:
    domain = Domain.parse(cups.domain.read_text())
    return Task(domain, Problem.parse(cups.problem.read_text(), domain))


@MANY
@given(tasks())
def test_plan_sets_equal_those_of_the_naive_enumerator(naive):
    task = grounded(naive)
    for semantics in SEMANTICS:
        plans = task.plan_set(3, semantics)
        found = list(plans)
        assert set(found) == naive.plans(3, semantics)
        assert len(found) == len(set(found)) == plans.count() == sum(plans.counts())


BOUNDS = st.none() | st.integers(-12, 12)
"""The parts of a slice; its step is not 0."""


@settings(MANY, max_examples=50)
@given(tasks(), st.builds(slice, BOUNDS, BOUNDS, BOUNDS.filter(lambda step: step != 0)))
def test_a_slice_selects_what_it_selects_of_a_list(naive, part):
    plans = grounded(naive).plan_set(2, "any")
    found = list(plans)
    assert list(plans[part]) == found[part]
    assert list(plans[:][part]) == found[part]
    assert plans[part].text() == plans[:][part].text()


@settings(MANY, max_examples=50)
@given(tasks())
def test_every_plan_is_where_its_rank_says_and_valid(naive):
    task = grounded(naive)
    plans = task.plan_set(3, "any")
    found = list(itertools.islice(plans, 300))
    assert [plans.rank(plan) for plan in found] == list(range(len(found)))
    assert [plans[i] for i in range(len(found))] == found
    assert all(verdict.is_valid for verdict in task.validate_many(["\n".join(plan) for plan in found]))
    flat = plans[: len(found)]
    codes, steps = task.validate_ids(flat.operators, flat.offsets)
    assert not codes.any()
    assert not steps.any()


@settings(MANY, max_examples=50)
@given(tasks())
def test_printing_and_parsing_changes_nothing(naive):
    domain = Domain.parse(naive.domain())
    problem = Problem.parse(naive.problem(), domain)
    again = Domain.parse(domain.to_pddl())
    assert again.to_pddl() == domain.to_pddl()
    assert list(Task(again, Problem.parse(problem.to_pddl(), again)).plan_set(3)) == list(
        Task(domain, problem).plan_set(3)
    )


def test_plans_are_ordered_by_length_and_sliced_as_sequences_are(task):
    plans = task.plan_set(6)
    everything = list(plans)
    assert everything == sorted(everything, key=lambda plan: (len(plan), [plans.rank(plan)]))
    assert list(plans[3:7]) == everything[3:7]
    assert list(plans[-2:]) == everything[-2:]
    assert plans[-1] == everything[-1]
    assert list(plans[5:2]) == []
    assert everything[4] in plans
    assert ("(pick red table)",) not in plans
    assert ("(fly red table)",) not in plans
    with pytest.raises(IndexError):
        plans[len(plans)]


def test_flat_arrays_hold_the_plans_and_cannot_be_written(task):
    plans = task.plan_set(6)
    flat = plans[:]
    assert (flat.operators.dtype, flat.offsets.dtype) == (np.uint32, np.int64)
    rows = [flat.operators[a:b] for a, b in itertools.pairwise(flat.offsets)]
    assert [tuple(task.operator_name(int(i)) for i in row) for row in rows] == list(plans)
    assert flat.text() == plans.text()
    with pytest.raises(ValueError, match="read-only"):
        flat.operators[0] = 7


def test_counts_are_exact_beyond_any_machine_word(task):
    plans = task.plan_set(200, "any")
    total = plans.count()
    assert total > 2**64
    assert plans.rank(plans[total - 1]) == total - 1
    assert math.isclose(plans.entropy(), math.log(total))
    with pytest.raises(OverflowError):
        len(plans)


def test_samples_are_uniform(task):
    plans = task.plan_set(6)
    draws = 200 * len(plans)
    hits = np.zeros(len(plans))
    for plan in plans.sample(draws, seed=1):
        hits[plans.rank(plan)] += 1
    expected = draws / len(plans)
    chi_square = ((hits - expected) ** 2 / expected).sum()
    assert chi_square < len(plans) + 4 * math.sqrt(2 * len(plans))
    with pytest.raises(ValueError, match="plans wanted"):
        plans.sample(len(plans) + 1, seed=1, replace=False)


def test_next_operators_split_the_set(task):
    plans = task.plan_set(6)
    following = plans.next_operators(["(pick red table)"])
    assert sum(count for _, count in following) == sum(plan[0] == "(pick red table)" for plan in plans)
    assert dict(plans.next_operators(plans[0]))[None] == 1


def test_verdicts_agree_over_text_and_ids(task):
    plans = task.plan_set(4, "any")[:]
    shuffled = np.random.default_rng(0).permutation(plans.operators).astype(np.uint32)
    codes, steps = task.validate_ids(shuffled, plans.offsets)
    rows = [shuffled[a:b] for a, b in itertools.pairwise(plans.offsets)]
    texts = ["\n".join(task.operator_name(int(i)) for i in row) for row in rows]
    verdicts = task.validate_many(texts)
    assert [OUTCOMES[code] for code in codes] == [verdict.outcome for verdict in verdicts]
    assert [int(step) or None for step in steps] == [verdict.step for verdict in verdicts]
    assert (task.outcomes(texts) == codes).all()


def test_errors_carry_their_place(cups):
    text = cups.domain.read_text().replace("(held ?c) (busy) (not", "(helt ?c) (busy) (not")
    with pytest.raises(PddlError) as raised:
        Domain.parse(text, "cups.pddl")
    assert (raised.value.file, raised.value.line) == ("cups.pddl", 8)
    assert str(raised.value).startswith(f"cups.pddl:8:{raised.value.column}: {raised.value.message}")
    assert "did you mean `held`" in str(raised.value)
    with pytest.raises(PddlError):
        Domain.parse(b"\xff\xfe(define", "utf16.pddl")


def test_limits_are_typed(cups):
    domain = Domain.parse(cups.domain.read_text())
    problem = Problem.parse(cups.problem.read_text(), domain)
    with pytest.raises(LimitError) as raised:
        Task(domain, problem, max_operators=3)
    assert raised.value.kind == "operators"
    with pytest.raises(LimitError) as raised:
        Task(domain, problem).plan_set(6, max_states=2)
    assert raised.value.kind == "states"


def test_ctrl_c_ends_a_call_within_200_ms():
    domain = Domain.parse(
        "(define (domain bits) (:requirements :adl) (:predicates (on ?x)) (:action flip :parameters (?x)"
        " :effect (and (when (on ?x) (not (on ?x))) (when (not (on ?x)) (on ?x)))))"
    )
    switches = " ".join(f"s{i}" for i in range(40))
    problem = f"(define (problem p) (:domain bits) (:init) (:objects {switches}) (:goal (and (on s1) (on s2))))"
    task = Task(domain, Problem.parse(problem, domain))
    sent = []

    def interrupt():
        sent.append(time.perf_counter())
        signal.raise_signal(signal.SIGINT)

    timer = threading.Timer(0.3, interrupt)
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        task.plan_set(60)
    assert time.perf_counter() - sent[0] < 1, "0.2 s on a quiet machine; tests run beside each other"


def test_the_pool_survives_a_fork(task):
    assert task.plan_set(4).count() == 4
    child = os.fork()
    if child == 0:
        os._exit(0 if task.plan_set(4).count() == 4 else 1)
    for _ in range(200):
        done, status = os.waitpid(child, os.WNOHANG)
        if done:
            break
        time.sleep(0.05)
    else:
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        pytest.fail("the child hangs")
    assert os.waitstatus_to_exitcode(status) == 0


def test_renaming_keeps_the_plans(cups):
    domain = Domain.parse(cups.domain.read_text())
    problem = Problem.parse(cups.problem.read_text(), domain)
    renamed = problem.rename(["mug", "jar", "bench", "rack"])
    assert Task(domain, renamed).plan_set(2)[0] == ("(pick mug bench)", "(put mug rack)")
    with pytest.raises(ValueError, match="different"):
        problem.rename(["mug", "mug", "bench", "rack"])
