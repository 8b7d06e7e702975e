"""Best-first search under a guide: of all prefixes so far, the one that the model finds likeliest is continued next.

A prefix costs minus the logarithm of its probability among what the guide allows; forced tokens cost nothing. Or it
costs only what it gives up against the model's favourite at each choice, so that the favourites are followed to their
end first, and what is tried next leaves them where the model doubts most (limited discrepancy search, Harvey & Ginsberg
1995, in nats): deeper on problems larger than any that the model has seen, with longer plans. A state
that was reached before, by a likelier prefix, is not continued again, so the search goes round no circle and backs out
of every dead end. It gives up after a number of model calls, so that the same budget gives the same answer; a budget of
seconds, each call's time shared among the prompts that it served, may be set beside it.

Price: one model call a prefix, batched over the prompts. A row of the cache keeps what the next prefix shares with the
last one and is fed the rest.

Asked to renew its prompt (`Renew`), the model forgets the steps that are done and reads the state that they led to as a
new prompt: the price is then a whole prompt for each first prefix of a step, and no text is too long.

It is anytime: asked for shorter plans, it keeps the best so far and goes on, among prefixes that can still become
shorter ones, until its budget is spent or nothing is left, and then the plan is a shortest one.
"""

from __future__ import annotations

import heapq
import time
from dataclasses import dataclass, field, replace
from itertools import takewhile
from typing import TYPE_CHECKING, Literal, Protocol, TypeAlias

import torch

from strips_lm.decode.loop import Generation, pad
from strips_lm.decode.masked import Guide, cut, room_for

if TYPE_CHECKING:
    from collections.abc import Callable, Hashable, Sequence

    from torch import Tensor

    from strips_lm.decode.loop import Decoder, Job, Limits
    from strips_lm.decode.masked import Renew


Order: TypeAlias = Literal["probability", "discrepancy"]


class SearchGuide(Guide, Protocol):
    """A guide that can go back, and knows when two texts have come to the same state."""

    def fork(self, row: int) -> int:
        """A new row that goes on from where `row` is."""

    def arrive(self, before: Hashable, tokens: Sequence[int]) -> Hashable:
        """The state after `tokens`, from the one `before` them (`None` at the start); equal values are equal states."""


@dataclass(slots=True, kw_only=True)
class _Prefix:
    """A text so far, at a choice or at its end."""

    row: int
    """The guide's number for it."""
    tokens: list[int]
    state: Hashable
    cost: float
    steps: int
    prompt: Sequence[int] | None
    """What the model reads before it; none where a prompt of its last state is still to be made."""
    begin: int = 0
    """Where, in `tokens`, the part that the model reads after that prompt begins."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Budget:
    """When a search gives up, whether it goes on after its first plan, and what it tries next."""

    calls: int
    """Calls of the model."""
    seconds: float = 0.0
    """A prompt's share of the time; 0 is no limit."""
    shorter: bool = False
    """Whether to look for shorter plans until the budget is spent."""
    order: Order = "probability"
    """What a prefix costs: by its probability, or by what it gives up against the model's favourites."""


@dataclass(slots=True)
class _Search:
    """One prompt's search."""

    job: Job
    room: int
    now: _Prefix
    """The prefix that the model is asked about next; at last the answer."""
    open: list[tuple[float, int, _Prefix, int]] = field(default_factory=list)
    """A heap of (cost, order, prefix, token to go on with)."""
    seen: dict[Hashable, int] = field(default_factory=dict)
    """The fewest steps in which each state was reached."""
    answer: _Prefix | None = None
    rows: list[int] = field(default_factory=list)
    held: list[int] = field(default_factory=list)
    """What the decoder's row has read."""
    pushed: int = 0
    calls: int = 0
    seconds: float = 0.0
    removed: float = 0.0

    def push(self, log_probs: Tensor, allowed: Tensor, order: Order) -> None:
        """Open every allowed continuation of the prefix; of equals the lowest token first."""
        tokens = allowed.nonzero()[:, 0].tolist()
        if order == "discrepancy":
            log_probs = log_probs - log_probs.max()
        for token, log_prob in zip(tokens, log_probs[allowed].tolist(), strict=True):
            heapq.heappush(self.open, (self.now.cost - log_prob, self.pushed, self.now, token))
            self.pushed += 1


class SearchLoop:
    """Runs searches through one decoder under one guide, a row for each."""

    def __init__(
        self,
        decoder: Decoder,
        guide: SearchGuide,
        limits: Limits,
        *,
        budget: Budget,
        on_done: Callable[[Generation], None] | None = None,
        renew: Renew | None = None,
    ) -> None:
        """Each search has the budget; `on_done` is called for each that is over.

        With `renew` the model forgets the steps of a prefix that are done.
        """
        self.decoder, self.guide, self.limits, self.budget, self.on_done = decoder, guide, limits, budget, on_done
        self.renew = renew
        self.capacity = len(decoder.lengths)
        self.device = decoder.lengths.device
        self.done: dict[tuple[int, int], Generation] = {}

    @torch.inference_mode()
    def run(self, jobs: Sequence[Job]) -> list[Generation]:
        """The likeliest text found for each job, in the order of `jobs`."""
        order = sorted(jobs, key=lambda job: len(job.ids))
        for start in range(0, len(order), self.capacity):
            searches = self._begin(order[start : start + self.capacity])
            while searches:
                began = time.perf_counter()
                self._expand(searches)
                share = (time.perf_counter() - began) / len(searches)
                for search in searches:
                    search.seconds += share
                searches = self._close([(search, self._advance(search)) for search in searches])
        return [self.done[job.prompt, job.draw] for job in jobs]

    def _begin(self, jobs: Sequence[Job]) -> list[_Search]:
        """A search for each job that has a choice at all."""
        self.decoder.clear(0, len(jobs))
        rows, forced = self.guide.add([job.prompt for job in jobs])
        found = []
        for job, row, tokens in zip(jobs, rows, forced, strict=True):
            state = self.guide.arrive(None, tokens)
            prompt, steps = list(map(int, job.ids)), tokens.count(self.guide.step)
            first = _Prefix(row=row, tokens=tokens, state=state, cost=0.0, steps=steps, prompt=prompt)
            room = room_for(job, self.limits.max_new, self.decoder.context, renewed=self.renew is not None)
            found.append(_Search(job, room, first, seen={state: 0}, rows=[row]))
        going = self.guide.is_open(rows)
        begun = [(s, more and len(s.now.tokens) < s.room) for s, more in zip(found, going, strict=True)]
        return self._close(begun)

    def _close(self, searches: Sequence[tuple[_Search, bool]]) -> list[_Search]:
        """Report the searches that are over, and move the rows of the others together."""
        going = [index for index, (_, more) in enumerate(searches) if more]
        for target, source in enumerate(going):
            if source != target:
                self.decoder.move(*torch.tensor([[source], [target]], device=self.device))
        for search, more in searches:
            if not more:
                self._report(search)
        return [searches[index][0] for index in going]

    def _report(self, search: _Search) -> None:
        self.guide.remove(search.rows)
        job, tokens = search.job, (search.answer or search.now).tokens
        finished = tokens[-1:] == [self.limits.stop] and len(tokens) <= search.room
        if not finished:
            tokens = cut(tokens, search.room, self.guide.step)
        made = Generation(job.prompt, job.draw, tokens, finished, 0.0, search.calls, search.removed)
        self.done[job.prompt, job.draw] = made
        if self.on_done is not None:
            self.on_done(made)

    def _expand(self, searches: Sequence[_Search]) -> None:
        """Ask the model about each search's prefix."""
        self._renew([search for search in searches if search.now.prompt is None])
        chunks = [self._rest(row, search) for row, search in enumerate(searches)]
        logits = self.decoder.feed(0, *pad(chunks, self.device)).float().cpu()
        allowed = torch.from_numpy(self.guide.mask([search.now.row for search in searches]))
        removed = logits.softmax(-1).masked_fill_(allowed, 0.0).sum(-1).tolist()
        log_probs = logits.masked_fill(~allowed, -torch.inf).log_softmax(-1)
        for index, search in enumerate(searches):
            search.push(log_probs[index], allowed[index], self.budget.order)
            search.calls += 1
            search.removed += removed[index]

    def _renew(self, searches: Sequence[_Search]) -> None:
        """Makes the prompts of the last states of the searches' prefixes."""
        if self.renew is None or not searches:
            return
        prompts = self.renew([(search.job.prompt, search.now.tokens[: search.now.begin]) for search in searches])
        for search, prompt in zip(searches, prompts, strict=True):
            search.now.prompt = prompt

    def _rest(self, row: int, search: _Search) -> list[int]:
        """What the decoder's row lacks of a prefix, at least its last token."""
        whole = [*(search.now.prompt or ()), *search.now.tokens[search.now.begin :]]
        same = sum(1 for _ in takewhile(lambda pair: pair[0] == pair[1], zip(search.held, whole, strict=False)))
        search.held = whole
        return whole[self.decoder.rewind(row, min(same, len(whole) - 1)) :]

    def _advance(self, search: _Search) -> bool:
        """Go on to the cheapest prefix that leads anywhere new; whether the model is to be asked about it."""
        while search.open and not self._is_spent(search):
            cost, _, parent, token = heapq.heappop(search.open)
            if search.answer is not None and parent.steps >= search.answer.steps:
                continue
            prefix = self._extend(search, parent, token, cost)
            if prefix.tokens[-1] == self.limits.stop and len(prefix.tokens) <= search.room:
                if search.answer is None or prefix.steps < search.answer.steps:
                    search.answer = prefix
                if not self.budget.shorter:
                    return False
            elif self._is_new(search, prefix, parent):
                search.now = prefix
                return True
        return False

    def _is_spent(self, search: _Search) -> bool:
        seconds = self.budget.seconds
        return search.calls >= self.budget.calls or (seconds > 0 and search.seconds >= seconds)

    def _extend(self, search: _Search, parent: _Prefix, token: int, cost: float) -> _Prefix:
        """The prefix with a token more, and with what is forced after it."""
        row = self.guide.fork(parent.row)
        search.rows.append(row)
        new = [token, *self.guide.advance([row], [token])[0]]
        steps, state = parent.steps + new.count(self.guide.step), self.guide.arrive(parent.state, new)
        prefix = replace(parent, row=row, tokens=parent.tokens + new, state=state, cost=cost, steps=steps)
        begun = max((i for i, made in enumerate(new) if made == self.guide.step), default=None)
        if self.renew is not None and begun is not None:
            prefix.prompt, prefix.begin = None, len(parent.tokens) + begun
        return prefix

    def _is_new(self, search: _Search, prefix: _Prefix, parent: _Prefix) -> bool:
        """Whether a prefix has room, can go on, and is within a step or at a state not reached before.

        Where shorter plans are sought, a state reached in fewer steps counts as new.
        """
        if len(prefix.tokens) >= search.room or not self.guide.is_open([prefix.row])[0]:
            return False
        if prefix.state is parent.state:
            return True
        known = search.seen.get(prefix.state)
        fresh = known is None or (self.budget.shorter and prefix.steps < known)
        if fresh:
            search.seen[prefix.state] = prefix.steps
        return fresh
