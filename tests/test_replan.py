"""Planning anew after every step: a plan made of first steps, and where it ends."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

pytest.importorskip("torch")

from strips_lm.generate import Completion
from strips_lm.replan import replan

if TYPE_CHECKING:
    from collections.abc import Sequence

PROMPT = "<|startoftext|> <GOAL> at(d) <INIT> at(a)"
NEXT = {"at(a)": "b", "at(b)": "c", "at(c)": "d"}
"""A line of places: each step goes on by one."""


def written(text: str, *, finished: bool = False) -> Completion:
    return Completion(text, len(text.split()), finished, 0.0, ids=[1] * len(text.split()))


def walking(prompts: Sequence[str], draws: int) -> list[list[Completion]]:
    """A model that goes one place on, and ends the text with the step that reaches the goal."""
    assert draws == 1
    steps = []
    for prompt in prompts:
        there = NEXT[prompt.rpartition("<INIT> ")[2]]
        end = " <|endoftext|>" if f"at({there})" in prompt.split("<INIT>")[0] else ""
        steps.append([written(f"<ACTION> go({there}) <STATE> at({there}){end}", finished=bool(end))])
    return steps


def test_a_plan_is_made_of_first_steps_from_the_states_that_were_written() -> None:
    near = PROMPT.replace("<INIT> at(a)", "<INIT> at(c)")
    ticks: list[int] = []
    long, short = replan([PROMPT, near], walking, 8, 500, ticks.append)
    steps = [f"<ACTION> go({place}) <STATE> at({place})" for place in "bcd"]
    assert long.text == " ".join(steps) + " <|endoftext|>"
    assert short.text == steps[-1] + " <|endoftext|>"
    assert long.finished
    assert long.tokens == len(long.text.split()) == len(long.ids)
    assert ticks == [1, 1, 2]


def test_a_step_back_gives_way_to_the_likeliest_drawn_one_that_leads_on() -> None:
    def hesitant(prompts: Sequence[str], draws: int) -> list[list[Completion]]:
        """Would always go back to the start; of several draws the last leads on."""
        back = written("<ACTION> back() <STATE> at(a)")
        return [[back] * (draws - 1) + walking([prompt], 1)[0] if draws > 1 else [back] for prompt in prompts]

    (made,) = replan([PROMPT], hesitant, 4, 500)
    assert made.text == replan([PROMPT], walking, 1, 500)[0].text
    assert made.finished
    steps, back = 3, 4
    assert made.tokens == len(made.text.split()) + steps * 4 * back, "tokens of steps not taken count, too"
    (stuck,) = replan([PROMPT], hesitant, 1, 500)
    assert (stuck.finished, stuck.text) == (False, "<ACTION> back() <STATE> at(a)")


def test_a_text_without_a_state_and_one_that_is_too_long_end_unfinished() -> None:
    (broken,) = replan([PROMPT], lambda prompts, _: [[written("<ACTION> go(")] for _ in prompts], 8, 500)
    assert (broken.text, broken.finished) == ("<ACTION> go(", False)
    (nothing,) = replan([PROMPT], lambda prompts, _: [[written("")] for _ in prompts], 8, 500)
    assert (nothing.text, nothing.finished) == ("", False)
    count = iter(range(100))
    (endless,) = replan([PROMPT], lambda _, __: [[written(f"<ACTION> x() <STATE> s({next(count)})")]], 8, 12)
    assert (endless.tokens, endless.finished) == (12, False)
