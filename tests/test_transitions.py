"""States in batches, against the naive task: what applies, where it leads, how far the goal is."""

from __future__ import annotations

import itertools
from collections import deque

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings

from naive import NaiveTask, State, apply, tasks
from strips_lm import Domain, Problem, Task

FEW = settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large])
MOST_STATES = 60


def grounded(naive: NaiveTask) -> Task:
    domain = Domain.parse(naive.domain())
    return Task(domain, Problem.parse(naive.problem(), domain))


def successors(naive: NaiveTask, state: State) -> dict[str, State]:
    """Where each applicable operator leads, by its name."""
    return {
        name: apply(action, binding, state)
        for name, action, binding in naive.operators()
        if all(literal.holds(state, binding) for literal in action.precondition)
    }


def reachable(naive: NaiveTask) -> list[State]:
    """The first reachable states in breadth-first order."""
    known, queue = {naive.init: None}, deque([naive.init])
    while queue and len(known) < MOST_STATES:
        for following in successors(naive, queue.popleft()).values():
            if following not in known:
                known[following] = None
                queue.append(following)
    return list(known)


def distance(naive: NaiveTask, state: State, most: int) -> int:
    """Steps of a shortest way to the goal, -1 where there is none of at most `most`."""
    layer, known = {state}, {state}
    for steps in range(most + 1):
        if any(map(naive.is_goal, layer)):
            return steps
        layer = {following for state in layer for following in successors(naive, state).values()} - known
        known |= layer
    return -1


def spelled(state: State) -> list[str]:
    return sorted(f"({' '.join(atom)})" for atom in state)


@FEW
@given(tasks())
def test_batches_say_what_the_naive_task_says(naive):
    task, states = grounded(naive), reachable(naive)
    packed = task.pack([spelled(state) for state in states])
    assert [sorted(atoms) for atoms in task.atoms(packed)] == [spelled(state) for state in states]
    assert (packed[:1] == task.initial_state()).all()
    assert task.is_goal(packed).tolist() == [naive.is_goal(state) for state in states]
    operators, offsets = task.applicable(packed)
    expected = [successors(naive, state) for state in states]
    for row, (first, last) in enumerate(itertools.pairwise(offsets)):
        assert sorted(expected[row]) == sorted(task.operator_name(int(id_)) for id_ in operators[first:last])
    following = task.successor(np.repeat(packed, np.diff(offsets), axis=0), operators)
    rows = np.repeat(np.arange(len(states)), np.diff(offsets))
    names = [task.operator_name(int(id_)) for id_ in operators]
    found = [sorted(atoms) for atoms in task.atoms(following)]
    assert found == [spelled(expected[row][name]) for row, name in zip(rows, names, strict=True)]


@FEW
@given(tasks())
def test_distances_are_those_of_the_naive_task(naive):
    task, states = grounded(naive), reachable(naive)[::7]
    packed = task.pack([spelled(state) for state in states])
    for most in (0, 2, 4):
        assert task.distance_to_goal(packed, most).tolist() == [distance(naive, state, most) for state in states]
        plan = task.shortest_plan(most)
        assert plan == task.plan_set(most).shortest()
        assert (-1 if plan is None else len(plan)) == distance(naive, naive.init, most)


@pytest.fixture
def task(cups) -> Task:
    domain = Domain.parse(cups.domain.read_text())
    return Task(domain, Problem.parse(cups.problem.read_text(), domain))


def test_walking_down_the_distance_is_a_shortest_plan(task):
    state, steps = task.initial_state(), 0
    while not task.is_goal(state)[0]:
        operators, _ = task.applicable(state)
        following = task.successor(np.repeat(state, len(operators), axis=0), operators)
        state = following[task.distance_to_goal(following).argmin()][None]
        steps += 1
    assert steps == task.plan_set(10).shortest_length()


def test_any_order_of_bytes_and_rows_is_read_right(task):
    packed = np.repeat(task.initial_state(), 6, axis=0)
    packed[1::2] = task.successor(packed[1::2], np.repeat(task.applicable(packed[:1])[0][:1], 3))
    assert task.applicable(packed[::2])[0].tolist() == np.tile(task.applicable(packed[:1])[0], 3).tolist()
    assert task.distance_to_goal(np.asfortranarray(packed)).tolist() == task.distance_to_goal(packed).tolist()
    assert task.applicable(packed[:0])[1].tolist() == [0]


def test_what_is_no_state_is_refused_and_named(task):
    state = task.initial_state()
    idle = np.setdiff1d(np.arange(task.num_operators, dtype=np.uint32), task.applicable(state)[0])
    with pytest.raises(ValueError, match=f"operator {idle[0]} is not applicable in state 0"):
        task.successor(state, idle[:1])
    with pytest.raises(ValueError, match="operator 4294967295 is not applicable in state 1"):
        task.successor(np.repeat(state, 2, axis=0), np.array([task.applicable(state)[0][0], 2**32 - 1], np.uint32))
    with pytest.raises(ValueError, match="2 operators for 1 states"):
        task.successor(state, idle[:2])
    with pytest.raises(ValueError, match="beyond the task's"):
        task.applicable(state | np.uint64(1 << 63))
    with pytest.raises(ValueError, match="words"):
        task.applicable(np.zeros((1, 5), np.uint64))
    with pytest.raises(ValueError, match=r"\(on cup moon\) is true in no state"):
        task.pack([["(on cup moon)"]])


def test_derived_atoms_follow_from_the_others():
    domain = Domain.parse(
        "(define (domain d) (:requirements :adl :derived-predicates) (:predicates (on ?x ?y) (above ?x ?y))"
        " (:derived (above ?x ?y) (or (on ?x ?y) (exists (?z) (and (on ?x ?z) (above ?z ?y)))))"
        " (:action drop :parameters (?x ?y) :precondition (above ?x ?y) :effect (not (on ?x ?y))))"
    )
    problem = "(define (problem p) (:domain d) (:objects a b c) (:init (on a b) (on b c)) (:goal (not (above a c))))"
    task = Task(domain, Problem.parse(problem, domain))
    packed = task.pack([["(on a b)", "(on b c)"], ["(ON a  b)", "(above a c)"]])
    assert (packed[:1] == task.initial_state()).all()
    assert task.atoms(packed)[1] == ["(on a b)", "(above a b)"]
    assert task.distance_to_goal(packed).tolist() == [1, 0]
