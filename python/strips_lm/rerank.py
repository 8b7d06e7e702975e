"""Which of several samples for one prompt is best: by the second head, by likelihood, step by step, or by the oracle.

By `replan` a sample is worth the likelihood of each of its steps as a first one: as the model finds it when it is
asked anew from the state before it, as the text says that state, with nothing else kept. A model that goes wrong late
in a long text, where its training had little, mostly knows better there; the oracle takes no part. A second head that
has learnt to judge steps is asked in the same way. Price: a forward pass over a prompt and a step for each step that
differs between a prompt's samples.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import torch
from torch.nn.functional import logsigmoid

from strips_lm.batches import padded_parts
from strips_lm.config import ConfigError
from strips_lm.decode.loop import pad
from strips_lm.forward import hidden_at
from strips_lm.replan import first_steps
from strips_lm.stepwise import log_probabilities
from strips_lm.tokenizer import encode_each

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from strips_lm.decode import Generation
    from strips_lm.generate import Completion, Planner

    Judge = Callable[[Sequence[int], Sequence[str]], Sequence[bool]]
    """The oracle as `best-of-k` needs it: whether each text is a valid plan for the prompt of that number."""


@dataclass(frozen=True, slots=True)
class Drawn:
    """Several samples for each prompt, prompt by prompt."""

    prompts: Sequence[str]
    ids: Sequence[Any]
    """Each prompt's tokens."""
    made: list[Generation]
    texts: list[Completion]
    seconds: float

    def whole(self, index: int) -> list[int]:
        """Prompt and completion of one sample."""
        made = self.made[index]
        return [*map(int, self.ids[made.prompt]), *made.tokens]


@dataclass(frozen=True, slots=True)
class Rating:
    """What every sample is worth, and how long it took to say so."""

    scores: list[float]
    """Higher is better; logits, nats, or 1 for a valid plan."""
    seconds: float

    def best(self, drawn: Drawn) -> list[int]:
        """Of each prompt the sample of highest score, then of highest likelihood; unfinished texts come last."""
        found: dict[int, int] = {}
        keys = [(g.finished, score, g.log_probability) for g, score in zip(drawn.made, self.scores, strict=True)]
        for index, g in enumerate(drawn.made):
            if g.prompt not in found or keys[index] > keys[found[g.prompt]]:
                found[g.prompt] = index
        return [found[prompt] for prompt in range(len(drawn.prompts))]


def rate(planner: Planner, drawn: Drawn, rerank: str, judge: Judge | None = None) -> Rating:
    """Rates every sample in one of the ways of `Rerank`.

    Raises:
        ConfigError: it takes a head or an oracle that is not there.
    """
    started = time.perf_counter()
    if rerank == "auto":
        rerank = "head" if planner.judging.judges_steps else "replan"
    if rerank == "head":
        scores = head_scores(planner, drawn)
    elif rerank == "replan":
        scores = replan_scores(planner, drawn)
    elif rerank == "likelihood":
        scores = [g.log_probability for g in drawn.made]
    elif judge is not None:
        scores = list(map(float, judge([g.prompt for g in drawn.made], [c.text for c in drawn.texts])))
    else:
        raise ConfigError("`--rerank oracle` needs the problem to check plans against")
    return Rating(scores, time.perf_counter() - started)


def head_scores(planner: Planner, drawn: Drawn) -> list[float]:
    """What the second head says of every sample.

    A head that judges steps: the log-probability that all steps hold, as `by_steps`. Another: the logit read at the
    sample's last token.

    Raises:
        ConfigError: the model has no such head.
    """
    if planner.judging.judges_steps:
        return by_steps(log_chances, planner.judging, *_finished(drawn))
    if not planner.has_head:
        raise ConfigError("this model has no multiple-choice head\nhint: choose by replan, or train double-head")
    return _logits(planner, [drawn.whole(index) for index in range(len(drawn.made))])


def plan_log_chances(planner: Planner, prompts: Sequence[str], plans: Sequence[Completion]) -> list[float]:
    """The log-probability that all steps of each plan hold, as a head that judges steps has it."""
    return by_steps(log_chances, planner, prompts, [plan.text if plan.finished else "" for plan in plans])


def log_chances(planner: Planner, pairs: Sequence[tuple[str, str]]) -> list[float]:
    """Of each step, after the prompt that asks for it, the log-probability that it holds, as the second head has it.

    It is minus infinity where both do not fit the model's context, or have no tokens.
    """
    rows = _rows(planner, pairs)
    logits = _logits(planner, [[*map(int, prompt), *map(int, step)] for _, prompt, step in rows])
    found = [-math.inf] * len(pairs)
    chances = logsigmoid(torch.tensor(logits, dtype=torch.float64)).tolist()
    for (index, *_), chance in zip(rows, chances, strict=True):
        found[index] = chance
    return found


@torch.inference_mode()
def _logits(planner: Planner, texts: Sequence[Sequence[int]]) -> list[float]:
    """The second head's logit of each text."""
    found = [0.0] * len(texts)
    for part in padded_parts(list(map(len, texts))):
        for index, logit in zip(part, _head_logits(planner.model, [texts[i] for i in part]), strict=True):
            found[index] = logit
    return found


def _head_logits(model: Any, texts: Sequence[Sequence[int]]) -> list[float]:
    """The multiple-choice head's logit for each token sequence, read at its last token.

    The last token of a text that filled the model's context has no position of its own; it gets the one before it.
    """
    ids, counts = pad(texts, model.device)
    places = torch.arange(ids.shape[1], device=ids.device).clamp(max=model.config.n_positions - 1).expand_as(ids)
    at = torch.arange(len(texts), device=ids.device) * ids.shape[1] + counts - 1
    hidden = hidden_at(model.transformer, ids, places, at, torch.float32)
    logits: list[float] = model.multiple_choice_head.summary(hidden).view(-1).tolist()
    return logits


def replan_scores(planner: Planner, drawn: Drawn) -> list[float]:
    """The log-likelihood of every sample, in nats, each of its steps as the first one after the state before it."""
    return by_steps(_log_likelihoods, planner, *_finished(drawn))


def _finished(drawn: Drawn) -> tuple[list[str], list[str]]:
    """Prompts and texts of the samples, those without an end as no text at all."""
    texts = [text.text if g.finished else "" for g, text in zip(drawn.made, drawn.texts, strict=True)]
    return [drawn.prompts[g.prompt] for g in drawn.made], texts


def by_steps(
    worth: Callable[[Planner, Sequence[tuple[str, str]]], Sequence[float]],
    planner: Planner,
    prompts: Sequence[str],
    completions: Sequence[str],
) -> list[float]:
    """The sum of what each step of a completion is worth as the first one after the state before it.

    Steps that completions share are read once. A sum is minus infinity where there is no text, a state is left out
    before another step, or a step cannot be asked for.
    """
    pairs = zip(prompts, completions, strict=True)
    steps = [first_steps(prompt, text) if text else [] for prompt, text in pairs]
    different = list(dict.fromkeys(step for found in steps for step in found))
    known = dict(zip(different, worth(planner, different), strict=True))
    return [sum(known[step] for step in found) if found else -math.inf for found in steps]


def _rows(planner: Planner, pairs: Sequence[tuple[str, str]]) -> list[tuple[int, Any, Any]]:
    """(number, prompt's tokens, completion's) of those that fit the model's context and have tokens.

    A state that a model wrote may name more objects than there are slots.
    """
    rows = encode_each(planner.tokenizer.encode_records, *map(list, zip(*pairs, strict=True))) if pairs else []
    found = [(index, row[0], row[1]) for index, row in enumerate(rows) if row is not None]
    return [row for row in found if len(row[1]) + len(row[2]) <= planner.model_context]


def _log_likelihoods(planner: Planner, pairs: Sequence[tuple[str, str]]) -> list[float]:
    """Of each completion after its prompt, in nats.

    It is minus infinity where both do not fit the model's context, or have no tokens.
    """
    rows = _rows(planner, pairs)
    found = [-math.inf] * len(pairs)
    for part in padded_parts([len(prompt) + len(completion) for _, prompt, completion in rows]):
        numbers, prompts, completions = zip(*(rows[place] for place in part), strict=True)
        for number, tokens in zip(numbers, log_probabilities(planner, prompts, completions), strict=True):
            found[number] = math.fsum(log_probability for _, log_probability in tokens)
    return found
