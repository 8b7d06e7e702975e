"""Planning anew after every step: a plan made of first steps, and where it ends."""

from __future__ import annotations

from strips_lm.generate import Completion
from strips_lm.replan import replan

PROMPT = "<|startoftext|> <GOAL> at(d) <INIT> at(a)"
NEXT = {"at(a)": "b", "at(b)": "c", "at(c)": "d"}
"""A line of places: each step goes on by one."""


def written(text: str, *, finished: bool = False) -> Completion:
    return Completion(text, len(text.split()), finished, 0.0, ids=[1] * len(text.split()))


def walking(prompts: list[str]) -> list[Completion]:
    """A model that goes one place on, and ends the text with the step that reaches the goal."""
    steps = []
    for prompt in prompts:
        here = prompt.rpartition("<INIT> ")[2]
        there = NEXT[here]
        end = " <|endoftext|>" if f"at({there})" in prompt.split("<INIT>")[0] else ""
        steps.append(written(f"<ACTION> go({there}) <STATE> at({there}){end}", finished=bool(end)))
    return steps


def test_a_plan_is_made_of_first_steps_from_the_states_that_were_written() -> None:
    near = PROMPT.replace("<INIT> at(a)", "<INIT> at(c)")
    ticks: list[int] = []
    long, short = replan([PROMPT, near], walking, 500, ticks.append)
    steps = [f"<ACTION> go({place}) <STATE> at({place})" for place in "bcd"]
    assert long.text == " ".join(steps) + " <|endoftext|>"
    assert short.text == steps[-1] + " <|endoftext|>"
    assert long.finished
    assert long.tokens == len(long.text.split()) == len(long.ids)
    assert ticks == [1, 1, 2]


def test_a_state_that_comes_back_ends_the_walk() -> None:
    def circling(prompts: list[str]) -> list[Completion]:
        there = {"at(a)": "at(b)", "at(b)": "at(a)"}
        return [written(f"<ACTION> go() <STATE> {there[prompt.rpartition('<INIT> ')[2]]}") for prompt in prompts]

    (made,) = replan([PROMPT], circling, 500)
    assert not made.finished
    assert made.text == "<ACTION> go() <STATE> at(b) <ACTION> go() <STATE> at(a)"


def test_a_text_without_a_state_and_one_that_is_too_long_end_unfinished() -> None:
    (broken,) = replan([PROMPT], lambda prompts: [written("<ACTION> go(") for _ in prompts], 500)
    assert (broken.text, broken.finished) == ("<ACTION> go(", False)
    count = iter(range(100))
    (endless,) = replan([PROMPT], lambda prompts: [written(f"<ACTION> x() <STATE> s({next(count)})")], 12)
    assert (endless.tokens, endless.finished) == (12, False)
