"""Draws steps from a model for training prompts, and has the oracle say of each whether it holds.

Three sources, since a trained model is seldom wrong on what it was trained on. Whole plans, drawn at rising
temperatures: every step up to the first that is wrong. Single steps from the states of the records' own plans, drawn
hotter still. And the records themselves, with their corruptions up to the step that proves them wrong. Price: seven
samples a prompt, four of them of a step alone.
"""

from __future__ import annotations

import copy
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from strips_lm import _native
from strips_lm.own_steps import OwnStep
from strips_lm.replan import first_steps

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from strips_lm._native import Judgement
    from strips_lm.evaluate.suites import DataFolder, Item
    from strips_lm.generate import Planner

WHOLE, SINGLE = (1.0, 1.3, 1.6), (1.5, 2.5)
"""Temperatures of whole plans and of single steps."""

TOP_P, TOP_K = 0.99, 8
"""What is drawn from: of whole plans the likeliest tokens that hold this share, of single steps so many."""


def sample_steps(
    planner: Planner, data: DataFolder, items: Sequence[Item], tick: Callable[[int], None] = lambda _: None
) -> list[OwnStep]:
    """Different steps for records of the training split, in a fixed order.

    `tick` is called again and again while they are drawn; what it raises ends the drawing.
    """
    return list(_Sampling(planner, data, items, tick).steps().values())


class _Sampling:
    def __init__(self, planner: Planner, data: DataFolder, items: Sequence[Item], tick: Callable[[int], None]) -> None:
        self.planner, self.data, self.items, self.tick = planner, data, items, tick
        self.problems = [data.problem(item) for item in items]
        self.words = [data.words(item) for item in items]

    def steps(self) -> dict[tuple[str, str], OwnStep]:
        """Each step once, by its prompt and text."""
        found: dict[tuple[str, str], OwnStep] = {}
        for source in (self._records, self._whole, self._single):
            found |= {(step.prompt, step.step): step for step in source()}
        return found

    def _drawing(self, temperature: float, top_k: int, top_p: float, samples: int) -> Planner:
        found, config = copy.copy(self.planner), self.planner.config
        found.config = replace(config, samples=samples, temperature=temperature, top_k=top_k, top_p=top_p)
        found.seed = self.planner.seed + round(100 * temperature)
        return found

    def _whole(self) -> Iterator[OwnStep]:
        prompts = [item.prompt for item in self.items]
        for temperature in WHOLE:
            found = self._drawing(temperature, 0, TOP_P, 1).draw(prompts, self.tick)
            drawn = zip(found.made, found.texts, strict=True)
            ended = [(made.prompt, text.text) for made, text in drawn if made.finished]
            yield from self._judged([number for number, _ in ended], [text for _, text in ended], [0] * len(ended))

    def _single(self) -> Iterator[OwnStep]:
        """Two steps from a state of each record's own plan, whose steps before it are right."""
        rng = np.random.default_rng(self.planner.seed)
        known = [first_steps(item.prompt, item.completion) for item in self.items]
        for temperature in SINGLE:
            starts = [int(rng.integers(len(steps))) for steps in known]
            asked = [steps[start][0] for steps, start in zip(known, starts, strict=True)]
            drawn = self._drawing(temperature, TOP_K, 1.0, 2).first_steps(asked, 2)
            self.tick(len(asked))
            before = [" ".join(text for _, text in steps[:start]) for steps, start in zip(known, starts, strict=True)]
            rows = [(i, f"{before[i]} {step.text}".strip()) for i, found in enumerate(drawn) for step in found]
            numbers = [i for i, _ in rows]
            yield from self._judged(numbers, [text for _, text in rows], [starts[i] for i in numbers])

    def _records(self) -> Iterator[OwnStep]:
        """Steps of the records' plans and of their negatives, which have one fault each."""
        for texts in ([item.completion for item in self.items], [item.negative for item in self.items]):
            yield from self._judged(range(len(texts)), texts, [0] * len(texts))

    def _judged(self, numbers: Sequence[int], texts: Sequence[str], starts: Sequence[int]) -> Iterator[OwnStep]:
        """The steps of texts from so many on, up to the first that is wrong."""
        problems, words = [self.problems[i] for i in numbers], [self.words[i] for i in numbers]
        judged = _native.judge(self.data.domain, problems, texts, words)
        for number, text, judgement, start in zip(numbers, texts, judged, starts, strict=True):
            item = self.items[number]
            said = verdicts(judgement)
            steps = first_steps(item.prompt, text) if len(said) > start else []
            for (prompt, step), (_, verdict) in list(zip(steps, said, strict=False))[start:]:
                yield OwnStep(prompt, item.words, step, verdict == RIGHT, verdict)


RIGHT = "right"


def verdicts(judgement: Judgement) -> list[tuple[int, str]]:
    """The steps of a text, from 1, up to the first that is wrong, each with `right` or what is wrong with it.

    The end of a text is part of its last step. There are none where the text is malformed, or leaves a state out.
    """
    verdict, steps = judgement.verdict, judgement.steps
    if verdict.outcome == "syntax" or judgement.states_total != steps or steps == 0:
        return []
    faults = []
    if judgement.first_wrong_state is not None:
        faults.append((judgement.first_wrong_state, "wrong_state"))
    if not verdict.is_valid and (judgement.finished or judgement.executable_steps < steps):
        faults.append((min(judgement.executable_steps + 1, steps), verdict.outcome))
    last = min(place for place, _ in faults) if faults else steps + 1
    return [(place, RIGHT) for place in range(1, last)] + sorted(faults)[:1]
