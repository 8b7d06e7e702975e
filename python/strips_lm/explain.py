"""Why a model wrote the plan that it wrote: what else it might have said at every token, and what the oracle allows.

Allowed is what masked decoding allows: operators that can be executed and lead to a state not yet visited. The text is
put through the model once more, whole; the oracle's automaton walks beside it for as long as it can. It judges nothing:
where a plan goes wrong is the verdict's to say. Price: one forward pass.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import torch

from strips_lm.guides import oracle_guide

if TYPE_CHECKING:
    from collections.abc import Sequence

    from torch import Tensor

    from strips_lm.generate import Completion, Planner
    from strips_lm.guide import OracleGuide, Tasks
    from strips_lm.tokenizer import PlanTokenizer


@dataclass(frozen=True, slots=True)
class Choice:
    """One token that might have come."""

    word: str
    """In the prompt's own names."""
    probability: float
    """The model's, without any mask."""
    allowed: bool | None
    """Whether the oracle allows it; `None` where it cannot say."""


@dataclass(frozen=True, slots=True)
class Position:
    """One token of a text, and what might have stood there instead."""

    word: str
    probability: float
    allowed: bool | None
    removed: float | None
    """The probability of all tokens that the oracle does not allow."""
    choices: list[Choice]
    """The likeliest tokens, and the likeliest that the oracle allows; likeliest first."""


@dataclass(slots=True)
class Step:
    """One step of a text: an operator and a state, or at last the end alone."""

    words: str
    """The operator's words, or `<|endoftext|>`."""
    probability: float
    """The product over the operator's tokens."""
    positions: list[Position] = field(default_factory=list)
    """Of the operator's tokens, `<ACTION>` included."""
    state_probability: float | None = None
    """The product over the state's tokens; `None` where the text says no state."""
    state_written: str | None = None
    """The state as its words, and …"""
    state_true: str | None = None
    """… as it should be; `None` where the operator cannot be executed, or nothing is known of the mask."""


@torch.inference_mode()
def explain(planner: Planner, prompt: str, made: Completion, tasks: Tasks | None = None, most: int = 5) -> list[Step]:
    """The steps of a completion of `prompt`, with the `most` likeliest tokens at each place.

    `tasks` is the oracle for prompt 0. Without it, or where tokens spell names, nothing is said of the mask.
    """
    (ids,), (legend,) = planner.tokenizer.encode_prompts([prompt])
    whole = [*map(int, ids), *made.ids][: planner.model_context + 1]
    logits = planner.model(torch.tensor([whole[:-1]], device=planner.model.device)).logits
    shares = logits.view(-1, logits.shape[-1])[len(ids) - 1 :].float().softmax(-1).cpu()
    reader = _Reader(planner, legend, shares, most, _walk(planner, legend, tasks))
    for number, token in enumerate(whole[len(ids) :]):
        reader.read(number, token)
    return reader.close()


class _Walk:
    """The oracle's automaton beside one text, which need not follow it."""

    def __init__(self, guide: OracleGuide) -> None:
        (self.row,), (self.forced,) = guide.add([0])
        self.guide, self.lost = guide, False

    def allowed(self) -> Tensor | None:
        """Flags over the vocabulary; `None` where the text has left what can be executed."""
        if self.lost:
            return None
        flags = torch.from_numpy(self.guide.mask([self.row])[0])
        if self.forced:
            flags = torch.zeros_like(flags)
            flags[self.forced[0]] = True
        return flags

    def take(self, token: int) -> None:
        """Go on by one token; the text is lost where it is not allowed."""
        flags = self.allowed()
        if flags is None or not flags[token]:
            self.lost = True
        elif self.forced:
            del self.forced[0]
        else:
            self.forced = self.guide.advance([self.row], [token])[0]

    def true_state(self, ends: Sequence[int]) -> list[int] | None:
        """The tokens of the true state, which begins here; they count as taken."""
        if self.lost or self.forced[:1] != [self.guide.state]:
            return None
        stop = next((i for i, token in enumerate(self.forced) if token in ends), len(self.forced))
        found, self.forced = self.forced[:stop], self.forced[stop:]
        return found


def _walk(planner: Planner, legend: Any, tasks: Tasks | None) -> _Walk | None:
    if tasks is None or not planner.tokenizer.slots:
        return None
    return _Walk(oracle_guide(planner.tokenizer, [legend], tasks))


class _Reader:
    """Reads a text token by token into steps."""

    def __init__(self, planner: Planner, legend: Any, shares: Tensor, most: int, walk: _Walk | None) -> None:
        self.shares, self.most, self.walk = shares, most, walk
        self.tokenizer, self.legend = planner.tokenizer, legend
        self.step, self.state, self.end = markers(planner.tokenizer)
        self.steps: list[Step] = []
        self.operator: list[int] = []
        self.written: list[int] | None = None

    def read(self, number: int, token: int) -> None:
        """The text's token of that number; a text that does not begin with `<ACTION>` has a first step without."""
        if token in (self.step, self.end) or not self.steps:
            self._close_step()
            self.steps.append(Step("", 1.0))
        if token == self.state and self.written is None:
            self._open_state()
        if self.written is None:
            self._read_operator(number, token)
        else:
            self.written.append(token)
            now = self.steps[-1]
            now.state_probability = (now.state_probability or 0.0) * float(self.shares[number, token])

    def close(self) -> list[Step]:
        """The steps, when all is read."""
        self._close_step()
        return self.steps

    def _read_operator(self, number: int, token: int) -> None:
        now = self.steps[-1]
        allowed = self.walk.allowed() if self.walk else None
        now.positions.append(self._position(self.shares[number], token, allowed))
        now.probability *= float(self.shares[number, token])
        self.operator.append(token)
        if self.walk:
            self.walk.take(token)

    def _open_state(self) -> None:
        """The state begins; the automaton goes past the true one, whatever the text says."""
        self.written, now = [], self.steps[-1]
        now.state_probability = 1.0
        true = self.walk.true_state((self.step, self.end)) if self.walk else None
        if true is not None:
            now.state_true = self._words(true[1:])
        elif self.walk:
            self.walk.lost = True

    def _close_step(self) -> None:
        if not self.steps:
            return
        self.steps[-1].words = self._words(self.operator)
        if self.written is not None:
            self.steps[-1].state_written = self._words(self.written[1:])
        self.operator, self.written = [], None

    def _position(self, shares: Tensor, token: int, allowed: Tensor | None) -> Position:
        best = shares.topk(min(self.most, len(shares))).indices.tolist()
        if allowed is not None:
            count = min(self.most, int(allowed.sum()))
            best += (shares + 1.0).masked_fill(~allowed, 0.0).topk(count).indices.tolist()
        order = sorted(set(best), key=lambda i: (-float(shares[i]), i))
        choices = [Choice(self._word(i), float(shares[i]), _flag(allowed, i)) for i in order]
        removed = None if allowed is None else float(shares.masked_fill(allowed, 0.0).sum())
        return Position(self._word(token), float(shares[token]), _flag(allowed, token), removed, choices)

    def _words(self, tokens: Sequence[int]) -> str:
        return self.tokenizer.say(tokens, self.legend)

    def _word(self, token: int) -> str:
        """A token as people read it: where names have slots, these by the prompt's own names."""
        tokenizer = self.tokenizer
        return tokenizer.say([token], self.legend) if tokenizer.slots else str(tokenizer.hf.decode([token]))


def markers(tokenizer: PlanTokenizer) -> tuple[int, int, int]:
    """The tokens that begin a step, begin a state, and end a text."""
    step, state = (tokenizer.hf.get_vocab()[word] for word in ("<ACTION>", "<STATE>"))
    return step, state, tokenizer.end_id


def _flag(allowed: Tensor | None, token: int) -> bool | None:
    return None if allowed is None else bool(allowed[token])
