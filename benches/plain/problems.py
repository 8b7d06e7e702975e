"""Templates filled, random problems drawn, each solved: the problems of the plain twin's records."""

from __future__ import annotations

import random
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from plain.planning import Atom, Domain, Exploration, Operator, State, Task, read, typed

if TYPE_CHECKING:
    from collections.abc import Iterator

SCRAMBLE, LITERALS, FINAL_STATES = 12, 3, 2
"""As in the Rust crate: steps of the scrambling walk, literals of a drawn goal, final states of a template problem."""

Literals = list[tuple[Atom, bool]]


@dataclass
class Problem:
    """A problem without names, and the plans that its records are drawn from."""

    source: str
    task: Task
    goal: State | Literals
    """The whole final state, or literals."""
    plans: list[list[Operator]]
    plan_count: int
    shortest: int

    def reached(self, state: State) -> bool:
        return satisfied(self.goal, state)


def satisfied(goal: State | Literals, state: State) -> bool:
    if isinstance(goal, frozenset):
        return goal == state
    return all((atom in state) == truth for atom, truth in goal)


class Odometer:
    """Every combination of choices in turn, by doing the work again with the next one."""

    def __init__(self) -> None:
        self.digits: list[tuple[int, int]] = []
        self.asked = 0

    def below(self, count: int) -> int:
        if count == 1:
            return 0
        if self.asked == len(self.digits):
            self.digits.append((0, count))
        self.asked += 1
        return self.digits[self.asked - 1][0]

    def advance(self) -> bool:
        del self.digits[self.asked :]
        self.asked = 0
        while self.digits:
            taken, count = self.digits.pop()
            if taken + 1 < count:
                self.digits.append((taken + 1, count))
                return True
        return False


class Template:
    """A problem with holes (docs/templates.md)."""

    def __init__(self, text: str, domain: Domain) -> None:
        _, header, *sections = read(text)
        parts = {section[0]: section[1:] for section in sections}
        self.name, self.domain = header[1], domain
        self.parameters = typed(parts[":parameters"])
        self.least, self.most, *kinds = parts.get(":distractors", ["0", "0"])
        self.kinds = [(typed(kind[:3])[0], kind[3:]) for kind in kinds]
        self.init = parts[":init"]
        self.goal = parts.get(":goal")

    def expand(self) -> Iterator[tuple[list[tuple[str, str]], State]]:
        """Objects and initial state of every problem that the template stands for."""
        odometer = Odometer()
        yield self.fill(odometer)
        while odometer.advance():
            yield self.fill(odometer)

    def draw(self, draw: random.Random) -> tuple[list[tuple[str, str]], State]:
        return self.fill(draw)

    def fill(self, choices: Any) -> tuple[list[tuple[str, str]], State]:
        below = choices.randrange if isinstance(choices, random.Random) else choices.below
        filling = Filling(self.domain, below)
        for name, kinds in self.parameters:
            filling.add(name, kinds)
        filling.place(["and", *self.init], None)
        kind = 0
        for _ in range(int(self.least) + below(int(self.most) - int(self.least) + 1) if self.kinds else 0):
            first = kind if isinstance(choices, Odometer) else 0
            kind = first + below(len(self.kinds) - first)
            (name, kinds), forms = self.kinds[kind]
            filling.place(["and", *forms], filling.add(name, kinds))
        return filling.objects, frozenset(filling.init)

    def literals(self) -> Literals:
        """The goal, its placeholders being the first objects after the constants."""
        first = len(self.domain.constants)
        numbers = {name: number for number, (name, _) in enumerate(self.domain.constants)}
        numbers |= {name: first + number for number, (name, _) in enumerate(self.parameters)}
        (goal,) = self.goal or [["and"]]
        parts = goal[1:] if goal[0] == "and" else [goal]
        inner = [(part[1], False) if part[0] == "not" else (part, True) for part in parts]
        predicates = self.domain.predicates
        return [((predicates.index(a[0]), *(numbers[name] for name in a[1:])), truth) for a, truth in inner]


class Filling:
    """One filling of a template."""

    def __init__(self, domain: Domain, below: Any) -> None:
        self.domain, self.below = domain, below
        self.objects = list(domain.constants)
        self.numbers = {name: number for number, (name, _) in enumerate(domain.constants)}
        self.init: set[Atom] = set()

    def add(self, name: str, kinds: list[str]) -> int:
        self.numbers[name] = len(self.objects)
        self.objects.append((f"o{len(self.objects) - len(self.domain.constants)}", kinds[self.below(len(kinds))]))
        return self.numbers[name]

    def place(self, form: Any, this: int | None) -> None:
        if form[0] == "and":
            for part in form[1:]:
                self.place(part, this)
        elif form[0] == "oneof":
            fitting = [option for option in form[1:] if self.is_open(option, this)]
            if fitting:
                self.place(fitting[self.below(len(fitting))], this)
        else:
            terms = (self.term(hole, this) for hole in form[1:])
            self.init.add((self.domain.predicates.index(form[0]), *terms))

    def is_open(self, form: Any, this: int | None) -> bool:
        if form[0] == "oneof":
            return any(self.is_open(option, this) for option in form[1:])
        if form[0] == "and":
            return all(self.is_open(part, this) for part in form[1:])
        return all(self.candidates(hole[1], this) for hole in form[1:] if isinstance(hole, list))

    def candidates(self, kind: str, this: int | None) -> list[int]:
        fitting = (number for number, (_, own) in enumerate(self.objects) if self.domain.fits(own, [kind]))
        return [number for number in fitting if number != this]

    def term(self, hole: Any, this: int | None) -> int:
        if isinstance(hole, list):
            candidates = self.candidates(hole[1], this)
            return candidates[self.below(len(candidates))]
        return self.numbers[hole]


def template_problems(template: Template, most: int, config: Any, draw: random.Random) -> list[Problem]:
    """At most `most` problems of the template, those equal up to names once, and for each some whole final states."""
    filled = list(template.expand())
    filled = draw.sample(filled, min(len(filled), 8 * most))
    goal, fresh = template.literals(), {}
    for objects, init in filled:
        fresh.setdefault(shape(objects, init, goal), (objects, init))
    found = []
    for objects, init in draw.sample(list(fresh.values()), min(len(fresh), most)):
        task = Task(template.domain, objects, init)
        exploration = Exploration(task, config.max_steps, 1 << 60, lambda state: satisfied(goal, state))
        shortest, states = exploration.nearest(lambda state: satisfied(goal, state))
        if shortest == 0:
            continue
        found.append(solved(template.name, task, goal, exploration, (shortest, states), config, draw))
        found += [
            solved(template.name, task, state, exploration, (shortest, [state]), config, draw)
            for state in draw.sample(states, min(len(states), FINAL_STATES))
        ]
    return found


def random_problems(template: Template, wanted: int, config: Any, draw: random.Random) -> list[Problem]:
    """Problems from drawn and scrambled initial states, with goals at drawn distances; equal up to names once."""
    found: dict[int, Problem] = {}
    while len(found) < wanted:
        task = scrambled(template, draw)
        exploration = Exploration(task, config.max_steps, config.states_per_start)
        for _ in range(config.goals_per_state):
            problem = drawn_goal(task, exploration, config, draw)
            if problem is not None:
                found.setdefault(shape(task.objects, task.init, problem.goal), problem)
    return list(found.values())[:wanted]


def scrambled(template: Template, draw: random.Random) -> Task:
    objects, init = template.draw(draw)
    task, state = Task(template.domain, objects, init), init
    for _ in range(draw.randrange(SCRAMBLE + 1)):
        following = list(task.successors(state))
        if not following:
            break
        state = draw.choice(following)[1]
    task.init = state
    return task


def drawn_goal(task: Task, exploration: Exploration, config: Any, draw: random.Random) -> Problem | None:
    deepest = len(exploration.layers) - 1
    if deepest < 1:
        return None
    depth = 1 + draw.randrange(deepest)
    target = draw.choice(exploration.layers[depth])
    if draw.random() < config.state_goal_share:
        return solved("random", task, target, exploration, (depth, [target]), config, draw)
    changed = sorted(task.init ^ target)
    kept = sorted(draw.sample(changed, min(len(changed), 1 + draw.randrange(LITERALS))))
    goal = [(atom, atom in target) for atom in kept]
    found = exploration.nearest(lambda state: satisfied(goal, state))
    return solved("random", task, goal, exploration, found, config, draw) if found[0] > 0 else None


def solved(  # noqa: PLR0917
    source: str,
    task: Task,
    goal: State | Literals,
    exploration: Exploration,
    nearest: tuple[int, list[State]],
    config: Any,
    draw: random.Random,
) -> Problem:
    shortest, states = nearest
    plans = exploration.plans(states, config.plans_per_problem, draw)
    return Problem(source, task, goal, plans, exploration.count(states), shortest)


def shape(objects: list[tuple[str, str]], init: State, goal: State | Literals, rounds: int = 3) -> int:
    """Equal for problems that are equal up to names: colours of objects refined by the atoms that they stand in.

    Cheaper than a canonical form: refinement alone may take a few different problems for equal.
    """
    aims = [(atom, True) for atom in goal] if isinstance(goal, frozenset) else goal
    atoms = [(0, atom) for atom in init] + [(1 + truth, atom) for atom, truth in aims]
    colours = [hash((kind, name if number == 0 else "")) for number, (name, kind) in enumerate(objects)]
    for _ in range(rounds):
        seen: list[list[int]] = [[] for _ in objects]
        for role, (predicate, *args) in atoms:
            code = hash((role, predicate, *(colours[arg] for arg in args)))
            for place, arg in enumerate(args):
                seen[arg].append(hash((code, place)))
        colours = [hash((colour, *sorted(codes))) for colour, codes in zip(colours, seen, strict=True)]
    codes = sorted(hash((role, predicate, *(colours[arg] for arg in args))) for role, (predicate, *args) in atoms)
    return hash((tuple(sorted(colours)), tuple(codes)))
