"""The slow, obvious oracle: random small tasks, and all their plans by brute force over sets of atoms.

Written apart from the real one on purpose: nothing here knows bits, joins, layers or counts.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

from hypothesis import strategies as st

TYPES = {"thing": None, "box": "thing", "tin": "box"}
OBJECTS = {"a": "box", "b": "tin", "c": "thing"}
PREDICATES = {"flag": (), "open": ("box",), "on": ("thing", "thing")}

Atom = tuple[str, ...]
State = frozenset[Atom]


@dataclass(frozen=True)
class Literal:
    """An atom over variables and objects, or an equality, that must hold or must not."""

    atom: Atom
    positive: bool

    def pddl(self) -> str:
        text = f"({' '.join(self.atom)})"
        return text if self.positive else f"(not {text})"

    def holds(self, state: State, binding: dict[str, str]) -> bool:
        atom = bind(self.atom, binding)
        return (atom[1] == atom[2] if atom[0] == "=" else atom in state) == self.positive


@dataclass(frozen=True)
class Effect:
    """If the condition holds before, the atom comes or goes."""

    condition: tuple[Literal, ...]
    atom: Atom
    adds: bool

    def pddl(self) -> str:
        effect = Literal(self.atom, self.adds).pddl()
        return f"(when {conjunction(self.condition)} {effect})" if self.condition else effect


@dataclass(frozen=True)
class Action:
    """A lifted action; its parameters are ?x and ?y, as many as it has types."""

    name: str
    types: tuple[str, ...]
    precondition: tuple[Literal, ...]
    effects: tuple[Effect, ...]

    def parameters(self) -> list[str]:
        return ["?x", "?y"][: len(self.types)]

    def pddl(self) -> str:
        typed = " ".join(f"{name} - {kind}" for name, kind in zip(self.parameters(), self.types, strict=True))
        effects = " ".join(effect.pddl() for effect in self.effects)
        return (
            f"(:action {self.name} :parameters ({typed}) :precondition {conjunction(self.precondition)}"
            f" :effect (and {effects}))"
        )


@dataclass(frozen=True)
class NaiveTask:
    """A task as sets and tuples."""

    actions: tuple[Action, ...]
    init: State
    goal: tuple[Literal, ...]

    def domain(self) -> str:
        types = " ".join(f"{name} - {parent or 'object'}" for name, parent in TYPES.items())
        predicates = " ".join(
            f"({name} {' '.join(f'?v{i} - {kind}' for i, kind in enumerate(kinds))})"
            for name, kinds in PREDICATES.items()
        )
        actions = "\n".join(action.pddl() for action in self.actions)
        return f"(define (domain random) (:requirements :adl) (:types {types}) (:predicates {predicates})\n{actions})"

    def problem(self) -> str:
        objects = " ".join(f"{name} - {kind}" for name, kind in OBJECTS.items())
        init = " ".join(f"({' '.join(atom)})" for atom in sorted(self.init))
        return (
            f"(define (problem random-1) (:domain random) (:requirements :adl) (:objects {objects})"
            f" (:init {init}) (:goal {conjunction(self.goal)}))"
        )

    def operators(self) -> list[tuple[str, Action, dict[str, str]]]:
        found = []
        for action in self.actions:
            for objects in itertools.product(*([o for o in OBJECTS if is_a(o, kind)] for kind in action.types)):
                name = f"({' '.join([action.name, *objects])})"
                found.append((name, action, dict(zip(action.parameters(), objects, strict=True))))
        return found

    def is_goal(self, state: State) -> bool:
        return all(literal.holds(state, {}) for literal in self.goal)

    def plans(self, max_steps: int, semantics: str) -> set[tuple[str, ...]]:
        """Every plan of at most `max_steps` steps, by walking all sequences."""
        operators, found = self.operators(), set()
        walks = [((), (self.init,))]
        for _ in range(max_steps + 1):
            found |= {plan for plan, states in walks if is_plan(self, states, semantics)}
            walks = [
                ((*plan, name), (*states, apply(action, binding, states[-1])))
                for plan, states in walks
                for name, action, binding in operators
                if all(literal.holds(states[-1], binding) for literal in action.precondition)
            ]
        return found


def is_plan(task: NaiveTask, states: tuple[State, ...], semantics: str) -> bool:
    if not task.is_goal(states[-1]):
        return False
    if semantics != "any" and any(map(task.is_goal, states[:-1])):
        return False
    return semantics != "simple" or len(set(states)) == len(states)


def apply(action: Action, binding: dict[str, str], state: State) -> State:
    """Deletes first, then adds; every condition reads the state before."""
    firing = [e for e in action.effects if all(literal.holds(state, binding) for literal in e.condition)]
    kept = state - {bind(effect.atom, binding) for effect in firing if not effect.adds}
    return kept | {bind(effect.atom, binding) for effect in firing if effect.adds}


def bind(atom: Atom, binding: dict[str, str]) -> Atom:
    return tuple(binding.get(term, term) for term in atom)


def is_a(name: str, wanted: str) -> bool:
    kind: str | None = OBJECTS[name]
    while kind is not None and kind != wanted:
        kind = TYPES[kind]
    return kind == wanted


def is_kind(kind: str | None, wanted: str) -> bool:
    while kind is not None and kind != wanted:
        kind = TYPES[kind]
    return kind == wanted


def conjunction(literals: tuple[Literal, ...]) -> str:
    return f"(and {' '.join(literal.pddl() for literal in literals)})"


def atoms(draw: st.DrawFn, variables: dict[str, str]) -> Atom:
    """An atom whose terms fit its predicate's types."""
    terms = {**OBJECTS, **variables}
    name = draw(st.sampled_from(sorted(PREDICATES)))
    fitting = [[t for t in sorted(terms) if is_kind(terms[t], kind)] for kind in PREDICATES[name]]
    return (name, *(draw(st.sampled_from(choices)) for choices in fitting))


def literals(draw: st.DrawFn, variables: dict[str, str], most: int) -> tuple[Literal, ...]:
    return tuple(Literal(atoms(draw, variables), draw(st.booleans())) for _ in range(draw(st.integers(0, most))))


@st.composite
def actions(draw: st.DrawFn, name: str) -> Action:
    types = tuple(draw(st.lists(st.sampled_from(sorted(TYPES)), max_size=2)))
    variables = dict(zip(["?x", "?y"], types, strict=False))
    precondition = literals(draw, variables, 2)
    if len(types) == 2 and draw(st.booleans()):
        precondition += (Literal(("=", "?x", "?y"), draw(st.booleans())),)
    effects = tuple(
        Effect(literals(draw, variables, 1), atoms(draw, variables), draw(st.booleans()))
        for _ in range(draw(st.integers(0, 3)))
    )
    return Action(name, types, precondition, effects)


@st.composite
def tasks(draw: st.DrawFn) -> NaiveTask:
    """Tasks with subtypes, negation, equality, conditional effects, self-loops and operators of equal effects."""
    names = ["go", "do"][: draw(st.integers(1, 2))]
    init = frozenset(atoms(draw, {}) for _ in range(draw(st.integers(0, 4))))
    return NaiveTask(tuple(draw(actions(name)) for name in names), init, literals(draw, {}, 2))
