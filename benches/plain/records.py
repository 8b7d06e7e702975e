"""Records drawn from problems: names, words, text, a negative that is proven wrong; written as JSON Lines."""

from __future__ import annotations

import json
import random
import tomllib
from itertools import accumulate
from typing import TYPE_CHECKING, Any

from plain.planning import Atom, Domain, Operator, State, Task
from plain.problems import Problem, Template, random_problems, template_problems

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

Step = tuple[int, tuple[int, ...], list[Atom]]
"""An action, its arguments and the state after it, in the order of texts."""

ONSETS = ["b", "d", "f", "g", "h", "j", "k", "l", "m", "n", "p", "r", "s", "t", "v", "w", "z", "br", "dr", "kl", "pl"]
VOWELS = ["a", "e", "i", "o", "u", "oo"]
CODAS = ["", "", "", "n", "l", "r", "s", "m", "k"]
TRIES = 6


class Generator:
    """A data set's problems, and any number of records of them; `config` is a `DataConfig`."""

    def __init__(self, texts: dict[str, str], config: Any, seed: int = 0) -> None:
        draw = random.Random(seed)
        self.config, self.domain = config, Domain(texts["domain.pddl"])
        self.lexicon = tomllib.loads(texts["lexicon.toml"])
        templates = [Template(text, self.domain) for name, text in texts.items() if name.startswith("templates/")]
        kept = [template for template in templates if template.name not in config.held_out_templates]
        groups = [template_problems(template, config.problems_per_template, config, draw) for template in kept]
        start = Template(texts["random.pddl"], self.domain)
        self.groups = [*groups, random_problems(start, config.random_problems, config, draw)]
        share = config.train_template_share / len(groups)
        self.weights = [share] * len(groups) + [1 - config.train_template_share]
        self.sums = [
            list(accumulate(problem.shortest**config.train_steps_power for problem in group)) for group in self.groups
        ]
        self.numbers = {id(problem): n for n, problem in enumerate(p for group in self.groups for p in group)}

    @property
    def problems(self) -> list[Problem]:
        """Every problem, in the order of `problem_id`."""
        return [problem for group in self.groups for problem in group]

    def write(self, path: Path, records: int, seed: int = 0) -> None:
        """Writes that many records, a line each."""
        with path.open("w", encoding="utf-8") as file:
            for index in range(records):
                file.write(json.dumps(self.record(index, random.Random(f"{seed} {index}")), ensure_ascii=False) + "\n")

    def record(self, index: int, draw: random.Random) -> dict[str, Any]:
        """One record, with the columns of docs/record-format.md."""
        (number,) = draw.choices(range(len(self.groups)), self.weights)
        (problem,) = draw.choices(self.groups[number], cum_weights=self.sums[number])
        steps, last = trace(problem.task, draw.choice(problem.plans))
        names = self.names(problem.task.objects, draw)
        own = [action.name for action in self.domain.actions]
        uses_words = draw.random() < self.config.words_share
        words = [draw.choice(self.lexicon["actions"][name]["trained"]) for name in own] if uses_words else own
        kind, wrong, verdict, at = self.negative(problem, steps, draw)
        calls = [f"({' '.join([own[action], *(names[arg] for arg in args)])})" for action, args, _ in steps]
        return {
            "index": index,
            "prompt": self.prompt(problem, last, names, words if uses_words else None),
            "completion": self.completion(steps, names, words),
            "negative": self.completion(wrong, names, words),
            "plan": "\n".join(calls),
            "negative_kind": kind,
            "negative_verdict": verdict,
            "negative_step": at,
            "problem_id": self.numbers[id(problem)],
            "names": names,
            "words": words,
            "template": problem.source,
            "style": "typed",
            "goal_style": "state" if isinstance(problem.goal, frozenset) else "problem",
            "steps": len(steps),
            "optimal_steps": problem.shortest,
            "plan_count": str(problem.plan_count),
            "seed": draw.getrandbits(64),
        }

    def names(self, objects: list[tuple[str, str]], draw: random.Random) -> list[str]:
        """A name for each object: from the lexicon by its type, or made up."""
        names = [name for name, _ in self.domain.constants]
        for _, kind in objects[len(names) :]:
            listed = self.lexicon["objects"].get(kind, {"trained": []})["trained"]
            free = [name for name in listed if name not in names]
            if draw.random() < self.config.made_up_share or not free:
                names.append(made_up(draw, names))
            else:
                names.append(draw.choice(free))
        return names

    def prompt(self, problem: Problem, last: State, names: list[str], words: list[str] | None) -> str:
        kinds = ", ".join(f"{name} {kind}" for name, (_, kind) in zip(names, problem.task.objects, strict=True))
        text = f"<|startoftext|> <OBJECTS> {kinds}"
        if words is not None:
            pairs = zip((action.name for action in self.domain.actions), words, strict=True)
            text += f" <VOCAB> {', '.join(f'{name} {word}' for name, word in pairs)}"
        if isinstance(problem.goal, frozenset):
            goal = self.atoms(sorted(last), names)
        else:
            signs = (("" if truth else "not ", atom) for atom, truth in problem.goal)
            goal = ", ".join(f"{sign}{self.atoms([atom], names)}" for sign, atom in signs)
        return f"{text} <GOAL> {goal} <INIT> {self.atoms(sorted(problem.task.init), names)}"

    def atoms(self, atoms: list[Atom], names: list[str]) -> str:
        predicates = self.domain.predicates
        return ", ".join(f"{predicates[atom[0]]}({', '.join([names[arg] for arg in atom[1:]])})" for atom in atoms)

    def completion(self, steps: list[Step], names: list[str], words: list[str]) -> str:
        parts = [
            f"<ACTION> {words[action]}({', '.join([names[arg] for arg in args])}) <STATE>"
            f"{' ' if state else ''}{self.atoms(state, names)} "
            for action, args, state in steps
        ]
        return "".join(parts) + "<|endoftext|>"

    def negative(self, problem: Problem, steps: list[Step], draw: random.Random) -> tuple[str, list[Step], str, int]:
        """A completion that is proven wrong: how it was made, its steps, what is wrong with it and where."""
        kinds, weights = list(self.config.negatives), list(self.config.negatives.values())
        for _ in range(TRIES):
            kind = draw.choices(kinds, weights)[0]
            for _ in range(TRIES):
                wrong = CORRUPTIONS[kind](problem.task, steps, draw)
                fault = wrong is not None and self.fault(problem, wrong)
                if wrong is not None and fault:
                    return kind, wrong, *fault
        *before, (action, args, state) = steps
        wrong = [*before, (action, args, state[:-1])]
        return "missing-atom", wrong, *(self.fault(problem, wrong) or ("", 0))

    def fault(self, problem: Problem, steps: list[Step]) -> tuple[str, int] | None:
        """What is wrong with the steps, and at which of them."""
        state, wrong_state = problem.task.init, None
        for number, (action, args, said) in enumerate(steps, 1):
            kinds = [kinds for _, kinds in self.domain.actions[action].parameters]
            objects = problem.task.objects
            if not all(self.domain.fits(objects[arg][1], wanted) for arg, wanted in zip(args, kinds, strict=True)):
                return "type", number
            operator = problem.task.by_call.get((action, args))
            if operator is None or not operator.applicable(state):
                return "inapplicable", number
            state = operator.apply(state)
            if wrong_state is None and sorted(state) != said:
                wrong_state = ("wrong_state", number)
        return wrong_state if problem.reached(state) else ("goal_not_reached", len(steps) + 1)

    def problem_text(self, problem: Problem) -> str:
        """The problem in PDDL; for goals that are literals."""
        objects = " ".join(f"{name} - {kind}" for name, kind in problem.task.objects[len(self.domain.constants) :])
        names = [name for name, _ in problem.task.objects]

        def atom(atom: Atom) -> str:
            return f"({' '.join([self.domain.predicates[atom[0]], *(names[arg] for arg in atom[1:])])})"

        literals = problem.goal if isinstance(problem.goal, list) else [(fact, True) for fact in problem.goal]
        goal = " ".join(atom(fact) if truth else f"(not {atom(fact)})" for fact, truth in literals)
        init = " ".join(map(atom, sorted(problem.task.init)))
        return f"(define (problem p) (:domain d) (:objects {objects}) (:init {init}) (:goal (and {goal})))"


def trace(task: Task, plan: list[Operator]) -> tuple[list[Step], State]:
    """The plan's steps with the states after them, and the last state."""
    state, steps = task.init, []
    for operator in plan:
        state = operator.apply(state)
        steps.append((operator.action, operator.args, sorted(state)))
    return steps, state


def made_up(draw: random.Random, used: list[str]) -> str:
    while True:
        syllables = range(2 + draw.randrange(2))
        word = "".join(draw.choice(ONSETS) + draw.choice(VOWELS) + draw.choice(CODAS) for _ in syllables)
        if word not in used:
            return word


def shuffled(actions: bool, states: bool) -> Callable[[Task, list[Step], random.Random], list[Step] | None]:
    def corrupt(_task: Task, steps: list[Step], draw: random.Random) -> list[Step] | None:
        if len(steps) < 2:
            return None
        of_action = draw.sample(steps, len(steps)) if actions else steps
        of_state = draw.sample(steps, len(steps)) if states else steps
        return [(action, args, state) for (action, args, _), (*_, state) in zip(of_action, of_state, strict=True)]

    return corrupt


def drop_step(_task: Task, steps: list[Step], draw: random.Random) -> list[Step]:
    at = draw.randrange(len(steps))
    return steps[:at] + steps[at + 1 :]


def repeat_step(_task: Task, steps: list[Step], draw: random.Random) -> list[Step]:
    at = draw.randrange(len(steps))
    return [*steps[: at + 1], *steps[at:]]


def swap_steps(_task: Task, steps: list[Step], draw: random.Random) -> list[Step] | None:
    if len(steps) < 2:
        return None
    first, second = draw.sample(range(len(steps)), 2)
    steps = list(steps)
    steps[first], steps[second] = steps[second], steps[first]
    return steps


def wrong_argument(task: Task, steps: list[Step], draw: random.Random) -> list[Step]:
    at = draw.randrange(len(steps))
    action, args, state = steps[at]
    place = draw.randrange(len(args))
    other = draw.choice([number for number in range(len(task.objects)) if number != args[place]])
    return [*steps[:at], (action, (*args[:place], other, *args[place + 1 :]), state), *steps[at + 1 :]]


def missing_atom(_task: Task, steps: list[Step], draw: random.Random) -> list[Step]:
    at = draw.randrange(len(steps))
    action, args, state = steps[at]
    gone = draw.randrange(len(state))
    return [*steps[:at], (action, args, state[:gone] + state[gone + 1 :]), *steps[at + 1 :]]


def invented_atom(task: Task, steps: list[Step], draw: random.Random) -> list[Step] | None:
    at = draw.randrange(len(steps))
    action, args, state = steps[at]
    atom = draw.choice(sorted(draw.choice(task.operators).adds) or [None])
    if atom is None or atom in state:
        return None
    return [*steps[:at], (action, args, sorted([*state, atom])), *steps[at + 1 :]]


def other_goal(task: Task, steps: list[Step], draw: random.Random) -> list[Step] | None:
    """A random walk, about as long as the plan, with its true states."""
    state, before, plan = task.init, task.init, []
    for _ in range(max(1, len(steps) + draw.randrange(3) - 1)):
        following = list(task.successors(state))
        if not following:
            return None
        operator, after = draw.choice(following)
        if after == before and len(following) > 1:
            continue
        state, before = after, state
        plan.append(operator)
    return trace(task, plan)[0] or None


def prefix(_task: Task, steps: list[Step], draw: random.Random) -> list[Step]:
    return steps[: draw.randrange(len(steps))]


CORRUPTIONS: dict[str, Callable[[Task, list[Step], random.Random], list[Step] | None]] = {
    "shuffle-actions": shuffled(True, False),
    "shuffle-states": shuffled(False, True),
    "shuffle-both": shuffled(True, True),
    "drop-step": drop_step,
    "repeat-step": repeat_step,
    "swap-steps": swap_steps,
    "wrong-argument": wrong_argument,
    "missing-atom": missing_atom,
    "invented-atom": invented_atom,
    "other-goal": other_goal,
    "prefix": prefix,
}
