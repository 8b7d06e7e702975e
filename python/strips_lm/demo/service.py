"""What the demo's page asks for: domains and problems to begin with, PDDL read, a plan written step by step.

Everything is bounded: grounding, the oracle's search and the model's writing each by time. It knows no HTTP; answers
are values that JSON can hold.
"""

from __future__ import annotations

import itertools
import threading
import time
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any

from strips_lm import _native
from strips_lm.config import ConfigError, RunConfig
from strips_lm.evaluate.suites import read_synonyms
from strips_lm.generate import DECODES, GUIDED, check_decode
from strips_lm.guide import Tasks
from strips_lm.sources import built_in_domains, read_sources
from strips_lm.stepwise import stepwise
from strips_lm.trace import Step, trace

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from strips_lm._native import Judgement
    from strips_lm.demo.watch import WatchedPlanner
    from strips_lm.generate import Completion

    Tell = Callable[[dict[str, Any]], None]
    """Where the events of a plan in the making go."""

FEW = (
    *("data.pairs=24", "data.suite_records=0", "data.problems_per_template=3", "data.random_problems=8"),
    *(
        "data.states_per_start=300",
        "data.held_out_templates=[]",
        "data.plans_per_problem=1",
        "data.validation_share=0.1",
    ),
)
"""The configuration of a few example problems; making them takes less than a tenth of a second."""

MAX_FACTS, MAX_OPERATORS, MAX_STATES = 20_000, 50_000, 300_000
"""Largest task that is grounded, and most states that the oracle visits."""

SECONDS = 10.0
"""The oracle's time for grounding, and again for each search."""

HORIZONS = (7, 12, 20)
"""Steps of the longest plan that the oracle looks for, one after another until there is one."""


class TimeUpError(ConfigError):
    """The model took too long."""


class Service:
    """Answers for one model; one plan is written at a time."""

    def __init__(self, planner: WatchedPlanner, name: str, *, seconds: float = 30.0) -> None:
        """`seconds` bounds the model's writing."""
        self.planner, self.name, self.seconds = planner, name, seconds
        self.turn = threading.Lock()

    def about(self) -> dict[str, Any]:
        """The model, the domains to choose from, the ways of decoding."""
        domains = [{"name": name, "text": read_sources(name).texts["domain.pddl"]} for name in built_in_domains()]
        return {"model": self.name, "domains": domains, "decodes": self._decodes(), "trained": self._trained()}

    def example(self, domain: str, number: int) -> dict[str, Any]:
        """A problem of a built-in domain, another one for each number."""
        stream = read_sources(domain).stream(RunConfig.load(None, [*FEW, f"seed={number // 16}"]), jobs=1)
        batch = stream.batch("train", number % 16, number % 16 + 1)
        offsets, text = stream.problems()["problem"]
        at = int(batch["problem_id"][0])
        read = _native.Domain.parse(read_sources(domain).texts["domain.pddl"])
        problem = _native.Problem.parse(bytes(text[offsets[at] : offsets[at + 1]]), read)
        return {"problem": problem.rename(_strings(batch["names"])).to_pddl()}

    def read(self, domain: str, problem: str) -> dict[str, Any]:
        """The parts of a problem as PDDL, to be edited one by one; `goal` is null where it is no list of literals."""
        asked = Asked(domain, problem)
        own = set(asked.domain.constants)
        parts: dict[str, Any] = {
            "domain": asked.domain.name,
            "name": asked.read.name,
            "types": [name for name, _ in asked.domain.types],
            "predicates": asked.domain.predicates,
            "constants": asked.domain.constants,
            "objects": [found for found in asked.read.objects if found not in own],
            "warnings": [*asked.domain.warnings, *asked.read.warnings],
            "plain": "(:functions" not in domain,
        }
        found = trace(asked.prompt, "")
        return parts | {"init": [_pddl(atom) for atom in found.initial], "goal": [_pddl(atom) for atom in found.goal]}

    def solve(self, domain: str, problem: str, decode: str, tell: Tell) -> None:
        """Tells of the model's plan as it grows, of the verdict, and of what the oracle would do.

        Raises:
            ConfigError: the model cannot be decoded so, or took too long.
        """
        asked = Asked(domain, problem)
        tell({"event": "asked", "prompt": asked.prompt})
        started = time.monotonic()
        with self.turn:
            made = self._write(asked, check_decode(decode), tell)
            tell(self._answer(asked, made) | {"seconds": time.monotonic() - started})
        tell(oracle(asked.task, asked.judge(made.text)))

    def _write(self, asked: Asked, decode: str, tell: Tell) -> Completion:
        planner = self.planner.for_domain(asked.domain)
        found, legends = planner.tokenizer.encode_prompts([asked.prompt])
        ids: list[list[int]] = [row.tolist() for row in found]
        end, seen = time.monotonic() + self.seconds, [-1]

        def listen(tokens: list[int]) -> None:
            if time.monotonic() > end:
                raise TimeUpError(f"the model was stopped after {self.seconds:g} seconds")
            text = planner.tokenizer.decode_completions(ids, [tokens[len(ids[0]) :]], legends)[0]
            whole = text.rpartition("<ACTION>")[0]
            if text.count("<ACTION>") != seen[0]:
                seen[0] = text.count("<ACTION>")
                tell({"event": "steps", "steps": [_step(step) for step in trace(asked.prompt, whole).steps]})

        if decode.startswith("masked"):  # what the decoder holds may be a new prompt there, not the whole text
            planner.listen, planner.on_text = (lambda _: None), (lambda prompt, tokens: listen([*prompt, *tokens]))
        else:
            planner.listen, planner.on_text = listen, None
        return planner.complete([asked.prompt], decode, asked.holds, tasks=asked.tasks()).completions[0]

    def _answer(self, asked: Asked, made: Completion) -> dict[str, Any]:
        """The whole plan with the oracle's judgement of each step, and the model's probability of it."""
        judged = asked.judge(made.text)
        probable = stepwise(self.planner.for_domain(asked.domain), [asked.prompt], [made.text])[0]
        valid = judged.verdict.is_valid and made.finished
        steps = [_step(step) for step in trace(asked.prompt, made.text).steps]
        for number, (step, operator, state) in enumerate(
            zip(steps, probable.operators, probable.states, strict=False), 1
        ):
            step |= {"probability": operator, "state_probability": state, "applies": number <= judged.executable_steps}
            step["state_right"] = judged.first_wrong_state is None or number < judged.first_wrong_state
        reason = judged.verdict.reason if not judged.verdict.is_valid else "" if valid else "the text does not end"
        answer = {"event": "answer", "steps": steps, "valid": valid, "verdict": judged.verdict.outcome}
        removed = made.removed / made.choices if made.choices else None
        return answer | {"reason": reason, "step": judged.verdict.step, "tokens": made.tokens, "removed": removed}

    def _decodes(self) -> list[str]:
        """The ways of decoding that this model can be asked for."""
        guided = hasattr(self.planner.tokenizer, "codec")
        chooses = self.planner.judging.has_head or self.planner.config.rerank != "head"
        lacks = {*(() if guided else GUIDED), *(() if chooses else ("best-of-k",))}
        return [name for name in DECODES if name not in lacks]

    def _trained(self) -> list[str]:
        """The domains that the model's tokenizer knows; none where it spells names."""
        return [name for name, _ in getattr(self.planner.tokenizer, "domains", ())]


class Asked:
    """A problem as the page sent it: read, grounded, and as a prompt."""

    def __init__(self, domain: str, problem: str) -> None:
        """Reads it.

        Raises:
            PddlError: a text is wrong; the message has the line and a caret.
            LimitError: the task is too large.
        """
        self.domain = _native.Domain.parse(domain, "domain.pddl")
        self.read = _native.Problem.parse(problem, self.domain, "problem.pddl")
        limits = {"max_operators": MAX_OPERATORS, "max_facts": MAX_FACTS}
        self.task = _native.Task(self.domain, self.read, **limits, time_limit=SECONDS)
        actions = [name for name, _ in self.domain.actions]
        self.prompt = _native.render_prompt(self.task, "typed", actions)
        self.problem = self.read.to_pddl()
        known = _synonyms(self.domain.name) if self.domain.name in built_in_domains() else {}
        self.words = {**known, **{name: name for name in actions}}

    def judge(self, text: str) -> Judgement:
        """The oracle's judgement of a completion."""
        return _native.judge(self.domain, [self.problem], [text], [self.words])[0]

    def holds(self, _: Sequence[int], texts: Sequence[str]) -> list[bool]:
        """Which texts are valid plans."""
        return [self.judge(text).verdict.is_valid for text in texts]

    def tasks(self) -> Tasks:
        """The oracle as a guide."""
        names = [name for name, _ in self.read.objects]
        return Tasks(self.domain, lambda prompts: ([self.task] * len(prompts), [names] * len(prompts)))


def oracle(task: _native.Task, judged: Judgement) -> dict[str, Any]:
    """What the oracle would do, and how many plans are still open after each step of the model's."""
    try:
        for horizon in HORIZONS:
            plans = task.plan_set(horizon, max_states=MAX_STATES, time_limit=SECONDS)
            shortest = plans.shortest()
            if shortest is not None:
                break
    except _native.LimitError as error:
        return {"event": "oracle", "shortest": None, "note": f"no answer within the demo's limits: {error}"}
    if shortest is None:
        return {"event": "oracle", "shortest": None, "note": f"there is no plan of at most {horizon} steps"}
    counts = [str(count) for count in plans.counts()]
    open_ = _open(plans, judged)
    return {"event": "oracle", "shortest": list(shortest), "max_steps": horizon, "counts": counts, "open": open_}


def _open(plans: _native.PlanSet, judged: Judgement) -> list[str]:
    """How many plans begin with the first 0, 1, … steps that can be applied; no more than the longest plan has."""
    prefix = judged.plan.splitlines()[: min(judged.executable_steps, plans.max_steps)]
    heads = (prefix[:length] for length in range(1, len(prefix) + 1))
    after = (sum(count for _, count in plans.next_operators(head)) for head in heads)
    return [str(plans.count()), *map(str, after)]


def _synonyms(domain: str) -> dict[str, str]:
    return read_synonyms(Path(str(files("strips_lm") / "domains" / domain / "lexicon.toml")))


def _step(step: Step) -> dict[str, Any]:
    return {"operator": step.operator, "added": step.added, "removed": step.removed, "state": step.state}


def _pddl(literal: str) -> str:
    """`not on(a, b)` as `(not (on a b))`."""
    negative, atom = literal.startswith("not "), literal.removeprefix("not ")
    name, _, rest = atom.removesuffix(")").partition("(")
    spelled = f"({' '.join([name, *(part for part in rest.split(', ') if part)])})"
    return f"(not {spelled})" if negative else spelled


def _strings(column: Any) -> list[str]:
    """The only row of a column of lists of texts."""
    _, (offsets, text) = column
    return [bytes(text[a:b]).decode() for a, b in itertools.pairwise(offsets)]
