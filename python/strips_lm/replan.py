"""Planning anew after every step, from the state that the model itself wrote: `--decode replan`.

A prompt is a goal and an initial state, and a model that writes its states says where its first step leads. So it can
be asked again from there, with nothing else kept, and a plan longer than any that it was trained on becomes a row of
first steps. The oracle takes no part: a state that was written wrong is gone on from all the same, and the verdict on
the whole is the same as on any other text. It knows texts, and no model.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from strips_lm.generate import Completion

    Step = Callable[[Sequence[str]], Sequence[Completion]]
    """Of each prompt the model's first step, or all that it wrote where it ended before a second one."""

INIT, STATE = "<INIT> ", "<STATE> "


@dataclass(slots=True)
class _Walk:
    """What was written for one prompt so far, and the prompt to ask next."""

    prompt: str
    written: list[Completion] = field(default_factory=list)
    seen: set[str] = field(default_factory=set)

    def add(self, step: Completion) -> bool:
        """Takes the next step; whether there is one to ask for after it."""
        self.written.append(step)
        state = step.text.rpartition(STATE)[2].strip()
        before, init, here = self.prompt.rpartition(INIT)
        self.seen.add(here)
        if step.finished or not init or STATE not in step.text or state in self.seen:
            return False
        self.prompt = before + init + state
        return True

    def whole(self) -> Completion:
        """All steps as one text."""
        return replace(
            self.written[-1],
            text=" ".join(step.text for step in self.written),
            tokens=sum(step.tokens for step in self.written),
            ids=[token for step in self.written for token in step.ids],
        )


def replan(
    prompts: Sequence[str], step: Step, most_tokens: int, tick: Callable[[int], None] | None = None
) -> list[Completion]:
    """A plan for each prompt, made of first steps.

    It ends where the model ends it. Where a step brings back a state that was there before, or `most_tokens` tokens are
    written, it is left unfinished.
    """
    walks = [_Walk(prompt) for prompt in prompts]
    going = list(walks)
    while going:
        steps = step([walk.prompt for walk in going])
        going = [walk for walk, made in zip(going, steps, strict=True) if walk.add(made)]
        going = [walk for walk in going if sum(made.tokens for made in walk.written) < most_tokens]
        if tick is not None:
            tick(len(walks) - len(going))
    return [walk.whole() for walk in walks]
