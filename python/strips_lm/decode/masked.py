"""Decoding under a guide that says at every position which tokens may come, and which must.

The model is asked only where there is a choice: of the tokens allowed there the likeliest is taken. What the guide
forces after it is appended and fed together with it, so that a text costs a model call a choice and not a token. Where
nothing may come and the text is not over, steps are taken back until something may that was not tried: with a guide
that lets no state come twice that is a depth-first search in the model's order. A model that can be asked anew from any
state is asked so there, after some steps, and where its context is full. A text that went a long way round may give way
to a shorter one that the guide knows. How much probability the mask took away is counted at every choice. It knows
token ids, a decoder and a guide; no text, no model, no planning.

Price: a call is as wide as the longest chunk among its rows.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Protocol, TypeAlias

import torch

from strips_lm.decode.loop import Generation, pad

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    import numpy as np
    from numpy.typing import NDArray
    from torch import Tensor

    from strips_lm.decode.loop import Decoder, Job, Limits


Renew: TypeAlias = "Callable[[Sequence[tuple[int, Sequence[int]]]], Sequence[Sequence[int]]]"
"""Of each (prompt's number, tokens written after it) the prompt of going on from the last state in them."""

Listener: TypeAlias = "Callable[[Sequence[int], Sequence[int]], None]"
"""Hears a prompt and the tokens written after it."""


class Guide(Protocol):
    """Follows texts after their prompts, each in a row with a number of the guide's own."""

    step: int
    """The token that begins a step: a text that runs out of room is cut before one."""

    def add(self, prompts: Sequence[int]) -> tuple[list[int], list[list[int]]]:
        """Begin a row for each prompt; the rows' numbers, and the tokens forced in each."""

    def mask(self, rows: Sequence[int]) -> NDArray[np.bool_]:
        """Which tokens may come next: flags (rows, vocabulary)."""

    def advance(self, rows: Sequence[int], tokens: Sequence[int]) -> list[list[int]]:
        """Take the token chosen in each row; the tokens forced after it."""

    def is_open(self, rows: Sequence[int]) -> list[bool]:
        """Of each row whether any token may come."""

    def backtrack(self, row: int) -> tuple[int, list[int]] | None:
        """Take back steps of a row to where another may come; the steps left, and the tokens forced after them.

        `None` where the row has ended, or nothing is left to try.
        """

    def shortened(self, row: int) -> list[int] | None:
        """The tokens of a shorter text by way of what a row, which has ended, came to; `None` where there is none."""

    def remove(self, rows: Sequence[int]) -> None:
        """Forget rows."""


@dataclass(slots=True)
class _Text:
    """One continuation in the making."""

    job: Job
    row: int
    """The guide's number for it."""
    room: int
    """Tokens it may have."""
    tokens: list[int] = field(default_factory=list)
    fed: int = 0
    """Tokens that the decoder has read."""
    choices: int = 0
    removed: float = 0.0
    wasted: int = 0
    """Tokens of steps that were taken back."""
    lost: bool = False
    """Whether the decoder's row is of another text by now."""
    told: int = 0
    """Tokens that the prompt of the decoder's row stands for."""
    asked: int = 0
    """Tokens of that prompt."""

    def chunk(self) -> list[int]:
        """The tokens not yet fed; they count as fed from here on."""
        start, self.fed = self.fed, len(self.tokens)
        return self.tokens[start:]

    def last_step(self, step: int, after: int) -> int:
        """Where, from `after` on, the last step begins that is not the first; 0 where none does."""
        return max((i for i in range(after, len(self.tokens)) if self.tokens[i] == step), default=0)

    def generation(self, stop: int, step: int) -> Generation:
        """The text as a value, without a last step that has no room."""
        full = is_full(self.tokens, self.room, stop)
        tokens = cut(self.tokens, self.room, step) if full else self.tokens
        finished = tokens[-1:] == [stop]
        return Generation(self.job.prompt, self.job.draw, tokens, finished, 0.0, self.choices, self.removed)


def room_for(job: Job, most: int, context: int, *, renewed: bool) -> int:
    """Tokens that a text may have; the context need not hold the last, which is never fed, nor steps forgotten."""
    return most if renewed else min(most, context + 1 - len(job.ids))


def is_full(tokens: Sequence[int], room: int, stop: int) -> bool:
    """Whether no more tokens, or not even these, have room."""
    return len(tokens) > room or (len(tokens) == room and tokens[-1] != stop)


def cut(tokens: list[int], room: int, step: int) -> list[int]:
    """The tokens before the last step that begins within `room` tokens."""
    return tokens[: max((i for i in range(room + 1) if tokens[i : i + 1] == [step]), default=0)]


class MaskedLoop:
    """Runs jobs through one decoder under one guide."""

    def __init__(
        self,
        decoder: Decoder,
        guide: Guide,
        limits: Limits,
        *,
        on_done: Callable[[Generation], None] | None = None,
        renew: Renew | None = None,
        every: int = 0,
        backtrack: bool = False,
        shorten: bool = False,
        on_text: Listener | None = None,
    ) -> None:
        """`on_done` is called for each finished text, `on_text` after each choice in one that goes on.

        With `renew` the model reads a new prompt, of the state that the last step led to, where steps were taken back
        (`backtrack`; without it a text ends where nothing may come), where its context is full and, unless that is 0,
        after `every` so many steps, so that it forgets what is done. With `shorten` a text that has ended gives way
        to a shorter one that the guide has for it.
        """
        self.decoder, self.guide, self.limits, self.on_done = decoder, guide, limits, on_done
        self.renew, self.every, self.backtrack, self.on_text = renew, every, backtrack, on_text
        self.shorten = shorten
        self.capacity = len(decoder.lengths)
        self.device = decoder.lengths.device
        self.texts: list[_Text] = []
        self.done: dict[tuple[int, int], Generation] = {}

    @torch.inference_mode()
    def run(self, jobs: Sequence[Job]) -> list[Generation]:
        """All continuations, in the order of `jobs`."""
        waiting = sorted(jobs, key=lambda job: len(job.ids))
        logits = torch.empty(0, 0)
        while waiting or self.texts:
            if waiting and len(self.texts) <= self.capacity * 3 // 4:
                logits = self._admit(waiting, logits)
            if self.texts:
                self._choose(logits)
                self._retire()
            if self.on_text is not None:
                for text in self.texts:
                    self.on_text(text.job.ids, text.tokens)
            if self.texts:
                logits = self.decoder.feed(0, *pad(self._chunks(), self.device))
        return [self.done[job.prompt, job.draw] for job in jobs]

    def _admit(self, waiting: list[Job], logits: Tensor) -> Tensor:
        """Begin the longest waiting prompts in the free rows; the logits of all rows at work."""
        first = len(self.texts)
        new = [waiting.pop() for _ in range(min(self.capacity - first, len(waiting)))]
        rows, forced = self.guide.add([job.prompt for job in new])
        most, context, renewed = self.limits.max_new, self.decoder.context, self.renew is not None
        rooms = [room_for(job, most, context, renewed=renewed) for job in new]
        fresh = [_Text(job, row, room, asked=len(job.ids)) for job, row, room in zip(new, rows, rooms, strict=True)]
        for text, tokens in zip(fresh, forced, strict=True):
            text.tokens.extend(tokens)
        fresh = [text for text, ended in zip(fresh, self._ended(fresh), strict=True) if not ended]
        if not fresh:
            return logits
        self.texts.extend(fresh)
        self.decoder.clear(first, len(fresh))
        whole = [[*map(int, text.job.ids), *text.chunk()] for text in fresh]
        found = self.decoder.feed(first, *pad(whole, self.device))
        return torch.cat([logits, found]) if first else found

    def _chunks(self) -> list[list[int]]:
        """What each row reads next."""
        begins = [self._new_prompt(text) if self.renew else 0 for text in self.texts]
        chunks: list[list[int]] = []
        for row, (text, begin) in enumerate(zip(self.texts, begins, strict=True)):
            if text.lost or begin:
                self.decoder.clear(row, 1)
            again = [*map(int, text.job.ids)] if text.lost and not begin else []
            if text.lost:
                text.fed = text.told = 0
                text.asked, text.lost = len(text.job.ids), False
            chunks.append([*again, *text.chunk()])
        rows = [row for row, begin in enumerate(begins) if begin]
        if self.renew is None or not rows:
            return chunks
        done = [(self.texts[row].job.prompt, self.texts[row].tokens[: begins[row]]) for row in rows]
        for row, prompt in zip(rows, self.renew(done), strict=True):
            text = self.texts[row]
            text.told, text.asked = begins[row], len(prompt)
            chunks[row] = [*prompt, *text.tokens[text.told :]]
        return chunks

    def _new_prompt(self, text: _Text) -> int:
        """Where the step begins before which the model is to be asked anew; 0 where it goes on as it is."""
        if text.lost:
            return text.last_step(self.guide.step, 0)
        full = text.asked + len(text.tokens) - text.told > self.decoder.context
        if full or (self.every and text.tokens[text.told :].count(self.guide.step) > self.every):
            return text.last_step(self.guide.step, text.fed)
        return 0

    def _choose(self, logits: Tensor) -> None:
        """The likeliest allowed token of each row, and what is forced after it."""
        rows = [text.row for text in self.texts]
        allowed = torch.from_numpy(self.guide.mask(rows)).to(logits.device)
        removed = logits.float().softmax(-1).masked_fill_(allowed, 0.0).sum(-1).tolist()
        tokens = logits.masked_fill(~allowed, -torch.inf).argmax(-1).tolist()
        forced = self.guide.advance(rows, tokens)
        for text, token, after, share in zip(self.texts, tokens, forced, removed, strict=True):
            text.tokens.extend([token, *after])
            text.choices += 1
            text.removed += share

    def _retire(self) -> None:
        """Report the texts that are over, and move the last going rows into their places."""
        ended = torch.tensor(self._ended(self.texts))
        going = (~ended).nonzero()[:, 0]
        left = len(going)
        sources, targets = going[going >= left], ended[:left].nonzero()[:, 0]
        self.decoder.move(sources.to(self.device), targets.to(self.device))
        self.decoder.clear(left, len(ended) - left)
        for source, target in zip(sources.tolist(), targets.tolist(), strict=True):
            self.texts[target] = self.texts[source]
        del self.texts[left:]

    def _ended(self, texts: Sequence[_Text]) -> list[bool]:
        """Of each text whether nothing comes after it, steps taken back or not; those are reported."""
        going = self.guide.is_open([text.row for text in texts])
        if self.backtrack:
            going = [
                more or self._backtracks(row, text) for row, (text, more) in enumerate(zip(texts, going, strict=True))
            ]
        ended = [
            is_full(text.tokens, text.room, self.limits.stop) or not more
            for text, more in zip(texts, going, strict=True)
        ]
        over = [text for text, end in zip(texts, ended, strict=True) if end]
        for text in over:
            made = text.generation(self.limits.stop, self.guide.step)
            if self.shorten and made.finished:
                made = self._shortened(made, text.row)
            self.done[made.prompt, made.draw] = made
            if self.on_done is not None:
                self.on_done(made)
        self.guide.remove([text.row for text in over])
        return ended

    def _shortened(self, made: Generation, row: int) -> Generation:
        """The shorter text that the guide has for a row, or the text itself."""
        tokens = self.guide.shortened(row)
        if tokens is None:
            return made
        cut = made.tokens.count(self.guide.step) - tokens.count(self.guide.step)
        return replace(made, tokens=tokens, steps_cut=cut)

    def _backtracks(self, row: int, text: _Text) -> bool:
        """Takes back the steps of a text, in that row of the decoder, after which nothing may come.

        Whether something may come then; the tokens taken back count in what the text may have.
        """
        while text.wasted < self.limits.max_new and (found := self.guide.backtrack(text.row)):
            steps, forced = found
            start = [i for i, token in enumerate(text.tokens) if token == self.guide.step][steps]
            text.wasted += len(text.tokens) - start
            text.room = min(text.room, max(self.limits.max_new - text.wasted, 0))
            text.tokens[start:] = forced
            if start < text.fed:
                text.fed = start
                text.lost = text.lost or self.renew is not None or not self._rewind(row, text)
            if self.guide.is_open([text.row])[0]:
                return True
        return False

    def _rewind(self, row: int, text: _Text) -> bool:
        """Whether the decoder's row could forget all but the prompt and what was kept of the text."""
        return self.decoder.rewind(row, len(text.job.ids) + text.fed) > 0
