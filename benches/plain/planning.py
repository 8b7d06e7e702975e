"""PDDL read, grounded and searched: what the records of the plain twin stand on.

As much of PDDL as the built-in domains need: types, constants, and conditions and effects with `and`, `or`, `not`,
`imply`, `forall`, `exists`, `when` and `=`.
"""

from __future__ import annotations

import itertools
import re
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import random
    from collections.abc import Callable, Iterator

Atom = tuple[int, ...]
State = frozenset[Atom]
Condition = bool | tuple[str, Any, Any]
"""Settled, or ("literal", atom, truth), or ("and" or "or", parts, None)."""


def read(text: str) -> Any:
    """An S-expression as nested lists."""
    stack: list[list[Any]] = [[]]
    for token in re.findall(r"[()]|[^\s()]+", re.sub(r";[^\n]*", "", text.lower())):
        if token == "(":
            stack.append([])
        elif token == ")":
            done = stack.pop()
            stack[-1].append(done)
        else:
            stack[-1].append(token)
    return stack[0][0]


def typed(items: list[Any]) -> list[tuple[str, list[str]]]:
    """`a b - t c - (either u v)` as names with their types."""
    found: list[tuple[str, list[str]]] = []
    waiting: list[str] = []
    rest = iter(items)
    for item in rest:
        if item == "-":
            kind = next(rest)
            found += [(name, kind[1:] if isinstance(kind, list) else [kind]) for name in waiting]
            waiting = []
        else:
            waiting.append(item)
    return found + [(name, ["object"]) for name in waiting]


@dataclass
class Action:
    name: str
    parameters: list[tuple[str, list[str]]]
    precondition: Any
    effect: Any


class Domain:
    """A domain's types, constants, predicates and actions."""

    def __init__(self, text: str) -> None:
        sections = {section[0]: section[1:] for section in read(text)[2:] if section[0] != ":action"}
        self.parents = {name: kinds[0] for name, kinds in typed(sections.get(":types", []))}
        self.constants = [(name, kinds[0]) for name, kinds in typed(sections.get(":constants", []))]
        self.predicates = [predicate[0] for predicate in sections[":predicates"]]
        self.actions = []
        for section in read(text)[2:]:
            if section[0] == ":action":
                parts = dict(zip(section[2::2], section[3::2], strict=True))
                parameters = typed(parts.get(":parameters", []))
                self.actions.append(Action(section[1], parameters, parts.get(":precondition", []), parts[":effect"]))

    def fits(self, kind: str, wanted: list[str]) -> bool:
        """Whether an object of the type may stand where one of the `wanted` types is asked for."""
        while kind not in wanted and kind in self.parents:
            kind = self.parents[kind]
        return kind in wanted or "object" in wanted


@dataclass
class Operator:
    """A grounded action: what must hold, what must not, what else must hold; and its effects, some conditional."""

    action: int
    args: tuple[int, ...]
    true: State
    false: State
    others: list[Condition]
    adds: State
    deletes: State
    conditional: list[tuple[Condition, State, State]]

    def applicable(self, state: State) -> bool:
        return self.true <= state and self.false.isdisjoint(state) and all(holds(other, state) for other in self.others)

    def apply(self, state: State) -> State:
        adds, deletes = self.adds, self.deletes
        for condition, more, fewer in self.conditional:
            if holds(condition, state):
                adds, deletes = adds | more, deletes | fewer
        return (state - deletes) | adds


def holds(condition: Condition, state: State) -> bool:
    if isinstance(condition, bool):
        return condition
    kind, first, second = condition
    if kind == "literal":
        return (first in state) == second
    return (all if kind == "and" else any)(holds(part, state) for part in first)


@dataclass
class Task:
    """A problem without a goal, grounded."""

    domain: Domain
    objects: list[tuple[str, str]]
    """Names and types, constants first."""
    init: State
    operators: list[Operator] = field(default_factory=list)
    by_call: dict[tuple[int, tuple[int, ...]], Operator] = field(default_factory=dict)

    def __post_init__(self) -> None:
        grounder = Grounder(self.domain, self.objects)
        self.operators = list(grounder.operators())
        self.by_call = {(operator.action, operator.args): operator for operator in self.operators}

    def successors(self, state: State) -> Iterator[tuple[Operator, State]]:
        for operator in self.operators:
            if operator.applicable(state):
                yield operator, operator.apply(state)


class Grounder:
    """Puts objects in the place of parameters, and settles at once what no state can change."""

    def __init__(self, domain: Domain, objects: list[tuple[str, str]]) -> None:
        self.domain = domain
        self.objects = objects
        self.named = {name: number for number, (name, _) in enumerate(domain.constants)}
        self.predicates = {name: number for number, name in enumerate(domain.predicates)}

    def operators(self) -> Iterator[Operator]:
        for number, action in enumerate(self.domain.actions):
            for args in itertools.product(*(self.of(kinds) for _, kinds in action.parameters)):
                binding = dict(zip((name for name, _ in action.parameters), args, strict=True))
                condition = self.condition(action.precondition, binding, True)
                if condition is not False:
                    yield self.operator(number, args, condition, action.effect, binding)

    def operator(
        self, action: int, args: tuple[int, ...], condition: Condition, effect: Any, binding: dict[str, int]
    ) -> Operator:
        parts = condition[1] if isinstance(condition, tuple) and condition[0] == "and" else [condition]
        literals = [part for part in parts if isinstance(part, tuple) and part[0] == "literal"]
        others = [part for part in parts if isinstance(part, tuple) and part[0] != "literal"]
        true = frozenset(part[1] for part in literals if part[2])
        false = frozenset(part[1] for part in literals if not part[2])
        changes: dict[bool, list[tuple[Condition, Atom, bool]]] = {True: [], False: []}
        for change in self.effects(effect, binding, True):
            changes[change[0] is True].append(change)
        adds = frozenset(atom for _, atom, truth in changes[True] if truth)
        deletes = frozenset(atom for _, atom, truth in changes[True] if not truth)
        conditional = [
            (when, frozenset([atom] if truth else []), frozenset([] if truth else [atom]))
            for when, atom, truth in changes[False]
        ]
        return Operator(action, args, true, false, others, adds, deletes - adds, conditional)

    def of(self, kinds: list[str]) -> list[int]:
        return [number for number, (_, kind) in enumerate(self.objects) if self.domain.fits(kind, kinds)]

    def term(self, name: str, binding: dict[str, int]) -> int:
        return binding[name] if name.startswith("?") else self.named[name]

    def atom(self, form: list[str], binding: dict[str, int]) -> Atom:
        return (self.predicates[form[0]], *(self.term(name, binding) for name in form[1:]))

    def condition(self, form: Any, binding: dict[str, int], truth: bool) -> Condition:  # noqa: PLR0911
        """The form, or with `truth` false its negation, as `and` and `or` of literals."""
        match form:
            case []:
                return truth
            case ["not", inner]:
                return self.condition(inner, binding, not truth)
            case ["and" | "or" as head, *parts]:
                return joined((head == "and") == truth, [self.condition(part, binding, truth) for part in parts])
            case ["imply", first, then]:
                return self.condition(["or", ["not", first], then], binding, truth)
            case ["forall" | "exists" as head, variables, inner]:
                parts = [self.condition(inner, more, truth) for more in self.bindings(variables, binding)]
                return joined((head == "forall") == truth, parts)
            case ["=", first, second]:
                return (self.term(first, binding) == self.term(second, binding)) == truth
        return ("literal", self.atom(form, binding), truth)

    def effects(self, form: Any, binding: dict[str, int], when: Condition) -> Iterator[tuple[Condition, Atom, bool]]:
        match form:
            case ["and", *parts]:
                for part in parts:
                    yield from self.effects(part, binding, when)
            case ["forall", variables, inner]:
                for more in self.bindings(variables, binding):
                    yield from self.effects(inner, more, when)
            case ["when", condition, inner]:
                settled = joined(True, [when, self.condition(condition, binding, True)])
                if settled is not False:
                    yield from self.effects(inner, binding, settled)
            case ["not", inner]:
                yield when, self.atom(inner, binding), False
            case _:
                yield when, self.atom(form, binding), True

    def bindings(self, variables: list[Any], binding: dict[str, int]) -> Iterator[dict[str, int]]:
        names = typed(variables)
        for objects in itertools.product(*(self.of(kinds) for _, kinds in names)):
            yield binding | dict(zip((name for name, _ in names), objects, strict=True))


def joined(conjunction: bool, parts: list[Condition]) -> Condition:
    """`and` or `or` of the parts, flat, with what is settled left out."""
    head, flat = ("and" if conjunction else "or"), []
    for part in parts:
        if isinstance(part, bool):
            if part != conjunction:
                return part
        elif part[0] == head:
            flat += part[1]
        else:
            flat.append(part)
    if not flat:
        return conjunction
    return flat[0] if len(flat) == 1 else (head, flat, None)


class Exploration:
    """The states within reach, layer by layer, with every shortest way to each."""

    def __init__(self, task: Task, horizon: int, most: int, stop: Callable[[State], bool] = lambda _: False) -> None:
        self.layers = [[task.init]]
        self.depth = {task.init: 0}
        self.edges: dict[State, list[tuple[State, Operator]]] = {task.init: []}
        self.paths = {task.init: 1}
        while len(self.layers) <= horizon and len(self.depth) < most and not any(map(stop, self.layers[-1])):
            fresh: list[State] = []
            for state in self.layers[-1]:
                for operator, after in task.successors(state):
                    if after not in self.depth:
                        self.depth[after] = len(self.layers)
                        self.edges[after], self.paths[after] = [], 0
                        fresh.append(after)
                    if self.depth[after] == len(self.layers):
                        self.edges[after].append((state, operator))
                        self.paths[after] += self.paths[state]
            if not fresh:
                break
            self.layers.append(fresh)

    def nearest(self, goal: Callable[[State], bool]) -> tuple[int, list[State]]:
        """The distance to the goal and the states that satisfy it there; none where it is out of reach."""
        for depth, layer in enumerate(self.layers):
            found = [state for state in layer if goal(state)]
            if found:
                return depth, found
        return 0, []

    def count(self, states: list[State]) -> int:
        return sum(self.paths[state] for state in states)

    def plans(self, states: list[State], most: int, draw: random.Random) -> list[list[Operator]]:
        """Every shortest plan to the states, or `most` of them drawn uniformly."""
        if self.count(states) <= most:
            return [plan for state in states for plan in self.all_plans(state)]
        drawn = {tuple(map(id, plan)): plan for plan in (self.drawn_plan(states, draw) for _ in range(most))}
        return list(drawn.values())

    def all_plans(self, state: State) -> Iterator[list[Operator]]:
        if not self.edges[state]:
            yield []
        for parent, operator in self.edges[state]:
            for plan in self.all_plans(parent):
                yield [*plan, operator]

    def drawn_plan(self, states: list[State], draw: random.Random) -> list[Operator]:
        state = draw.choices(states, [self.paths[state] for state in states])[0]
        plan: list[Operator] = []
        while self.edges[state]:
            weights = [self.paths[parent] for parent, _ in self.edges[state]]
            state, operator = draw.choices(self.edges[state], weights)[0]
            plan.append(operator)
        return plan[::-1]
