"""Planning anew after every step, from the state that the model itself wrote: `--decode replan`.

A prompt is a goal and an initial state, and a model that writes its states says where its first step leads. So it can
be asked again from there, with nothing else kept, and a plan longer than any that it was trained on becomes a row of
first steps. Where the likeliest step leads back to a state that was there before, several are drawn, and the likeliest
of those that lead somewhere new is taken. The oracle takes no part: a state that was written wrong is gone on from all
the same, and the verdict on the whole is the same as on any other text. It knows texts, and no model.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from strips_lm.config import ConfigError

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from strips_lm.generate import Completion
    from strips_lm.tokenizer import PlanTokenizer

    Steps = Callable[[Sequence[str], int], Sequence[Sequence[Completion]]]
    """Of each prompt so many first steps, the likeliest first; a step that ends the text holds all of it."""

INIT, ACTION, STATE = "<INIT> ", "<ACTION> ", "<STATE> "


@dataclass(slots=True)
class _Walk:
    """What was written for one prompt so far, and the prompt to ask next."""

    prompt: str
    written: list[Completion] = field(default_factory=list)
    seen: set[str] = field(default_factory=set)
    wasted: int = 0
    """Tokens of steps that were not taken."""

    def is_new(self, step: Completion) -> bool:
        """Whether the step ends the text or leads to a state that was not there before."""
        return step.finished or _state(step) not in self.seen

    def take(self, step: Completion) -> bool:
        """Adds the step; whether there is one to ask for after it."""
        self.written.append(step)
        if step.finished or STATE not in step.text or not self.is_new(step):
            return False
        self.seen.add(_state(step))
        self.prompt = from_state(self.prompt, _state(step))
        return True

    def tokens(self) -> int:
        """Tokens of the steps that were taken."""
        return sum(step.tokens for step in self.written)

    def whole(self) -> Completion:
        """All steps as one text."""
        ids = [token for step in self.written for token in step.ids]
        text, tokens = " ".join(step.text for step in self.written), self.tokens() + self.wasted
        return replace(self.written[-1], text=text, tokens=tokens, ids=ids, log_probability=0.0)


def _state(step: Completion) -> str:
    """The state that a step says it leads to."""
    return step.text.rpartition(STATE)[2].strip()


def replan(
    prompts: Sequence[str], steps: Steps, draws: int, most_tokens: int, tick: Callable[[int], None] | None = None
) -> list[Completion]:
    """A plan for each prompt, made of first steps.

    It ends where the model ends it. Where none of `draws` steps leads to a new state either, or `most_tokens` tokens
    are written, it is left unfinished.
    """
    walks = [_Walk(prompt, seen={prompt.rpartition(INIT)[2].strip()}) for prompt in prompts]
    going = list(walks)
    while going:
        chosen = _choose(going, steps, draws)
        going = [walk for walk, step in zip(going, chosen, strict=True) if walk.take(step)]
        going = [walk for walk in going if walk.tokens() < most_tokens]
        if tick is not None:
            tick(len(walks) - len(going))
    return [walk.whole() for walk in walks]


def _choose(going: Sequence[_Walk], steps: Steps, draws: int) -> list[Completion]:
    """The next step of each walk."""
    chosen = [found[0] for found in steps([walk.prompt for walk in going], 1)]
    back = [i for i, (walk, step) in enumerate(zip(going, chosen, strict=True)) if not walk.is_new(step)]
    if not back or draws < 2:
        return chosen
    for i, found in zip(back, steps([going[i].prompt for i in back], draws), strict=True):
        asked = [chosen[i], *found]
        chosen[i] = next((step for step in found if going[i].is_new(step)), chosen[i])
        going[i].wasted += sum(step.tokens for step in asked) - chosen[i].tokens
    return chosen


@dataclass(frozen=True, slots=True)
class Encoded:
    """Prompts with their tokens and legends."""

    prompts: Sequence[str]
    ids: Sequence[Any]
    legends: Sequence[Any]

    def lists_objects(self) -> bool:
        """Whether all prompts list their objects, so that their slots are the same from another state."""
        return all("<OBJECTS>" in prompt for prompt in self.prompts)


class Renewal:
    """New prompts for texts that the oracle guides: those of a text's last state, in the same slots."""

    def __init__(self, tokenizer: PlanTokenizer, asked: Encoded) -> None:
        """For the prompts that were asked first.

        Raises:
            ConfigError: a prompt does not list its objects, so that its slots would not be the same from another state.
        """
        if not asked.lists_objects():
            raise ConfigError("planning anew needs prompts that list their objects\nhint: the style `typed` does")
        self.tokenizer, self.asked = tokenizer, asked

    def __call__(self, written: Sequence[tuple[int, Sequence[int]]]) -> list[list[int]]:
        """The prompts of going on after so many tokens of each text."""
        numbers = [number for number, _ in written]
        tokens = [list(made) for _, made in written]
        ids, legends = [self.asked.ids[i] for i in numbers], [self.asked.legends[i] for i in numbers]
        texts = self.tokenizer.decode_completions(ids, tokens, legends)
        pairs = zip(numbers, texts, strict=True)
        renewed = [from_state(self.asked.prompts[i], text.rpartition(STATE)[2].strip()) for i, text in pairs]
        return [list(map(int, row)) for row in self.tokenizer.encode_prompts(renewed)[0]]


def first_steps(prompt: str, completion: str) -> list[tuple[str, str]]:
    """Each step of a completion, with the prompt that asks for it as a first one; the last with what comes after it.

    The states are those that the completion says, right or wrong. There are none where it says none before a step.
    """
    begin, *steps = completion.split(ACTION)
    if begin.strip() or not steps:
        return [] if steps else [(prompt, completion)]
    pairs = []
    for step in steps:
        pairs.append((prompt, (ACTION + step).strip()))
        prompt = from_state(prompt, step.partition(STATE)[2].strip())
    return pairs if all(STATE in step for step in steps[:-1]) else []


def from_state(prompt: str, state: str) -> str:
    """The prompt with another initial state."""
    before, init, _ = prompt.rpartition(INIT)
    return before + init + state
