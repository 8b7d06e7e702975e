"""The decoding loop: a fixed number of rows, refilled from the waiting prompts as soon as enough of them are done.

Prompts go longest first, so that rows of like length share a batch. Finished rows leave at once: the last rows move
into the holes, and the matrices shrink. It knows token ids, a decoder and a choice; no text, no model.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import torch

from strips_lm.decode.choose import uniforms

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from torch import Tensor


class Decoder(Protocol):
    """Rows of decoding state, whatever the model behind them."""

    context: int
    lengths: Tensor

    def feed(self, first: int, ids: Tensor, counts: Tensor) -> Tensor:
        """Append tokens to the rows from `first` on; the logits after the last of each."""

    def move(self, sources: Tensor, targets: Tensor) -> None:
        """Copy rows over rows."""

    def clear(self, first: int, count: int) -> None:
        """Empty rows."""

    def rewind(self, row: int, count: int) -> int:
        """Forget a row's tokens but the first `count`, or all where that cannot be; how many are left."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """When a row ends."""

    stop: int
    """The token that ends a text; it is kept as the last token."""
    max_new: int = 500
    """At most this many new tokens."""
    pause: int | None = None
    """A token before which a row ends, unless it is the row's first."""


@dataclass(frozen=True, slots=True)
class Job:
    """One continuation to make: `draw` tells apart several for one prompt."""

    prompt: int
    draw: int
    ids: Sequence[int]


@dataclass(frozen=True, slots=True)
class Generation:
    """One continuation of one prompt."""

    prompt: int
    draw: int
    tokens: list[int]
    finished: bool
    """Whether it ended by the stop token."""
    log_probability: float
    """Sum over its tokens, in nats, under the whole distribution; 0 where it was not asked for."""
    choices: int = 0
    """Under a mask: tokens that the model chose; all others were forced."""
    removed: float = 0.0
    """Under a mask: the probability that it took away, summed over the choices."""
    by_oracle: bool = False
    """Whether the oracle's own search wrote it, the model having found no end."""
    steps_cut: int = 0
    """Under a mask: steps of the model's text that a shorter way made needless."""


class Runs(Protocol):
    """A loop of any kind."""

    def run(self, jobs: Sequence[Job]) -> list[Generation]:
        """All continuations, in the order of `jobs`."""


@dataclass(slots=True)
class _Rows:
    """What the loop keeps for each row: the first `active` rows are at work."""

    jobs: list[Job]
    made: Tensor
    tokens: Tensor
    uniform: Tensor
    score: Tensor

    @classmethod
    def empty(cls, rows: int, max_new: int) -> _Rows:
        """No row at work."""
        counts = torch.zeros(rows, dtype=torch.long)
        tokens = torch.zeros(rows, max_new, dtype=torch.long)
        return cls([], counts, tokens, torch.zeros(rows, max_new), torch.zeros(rows, dtype=torch.float64))

    def move(self, sources: list[int], targets: list[int]) -> None:
        """Copy rows over rows."""
        for values in (self.made, self.tokens, self.uniform, self.score):
            values[targets] = values[sources]
        for source, target in zip(sources, targets, strict=True):
            self.jobs[target] = self.jobs[source]

    def take(self, row: int, limits: Limits) -> Generation:
        """The finished row as a value."""
        job, tokens = self.jobs[row], self.tokens[row, : int(self.made[row])].tolist()
        if len(tokens) > 1 and tokens[-1] == limits.pause:
            tokens.pop()
        finished = bool(tokens) and tokens[-1] == limits.stop
        return Generation(job.prompt, job.draw, tokens, finished, float(self.score[row]))


class Loop:
    """Runs jobs through one decoder."""

    def __init__(
        self,
        decoder: Decoder,
        choose: Callable[[Tensor, Tensor], Tensor],
        limits: Limits,
        *,
        seed: int = 0,
        score: bool = False,
        on_done: Callable[[Generation], None] | None = None,
    ) -> None:
        """`on_done` is called for each finished row; `score` sums the log-probabilities."""
        self.decoder, self.choose, self.limits = decoder, choose, limits
        self.seed, self.score, self.on_done = seed, score, on_done
        self.capacity = len(decoder.lengths)
        self.rows = _Rows.empty(self.capacity, limits.max_new)
        self.device = decoder.lengths.device

    @torch.inference_mode()
    def run(self, jobs: Sequence[Job]) -> list[Generation]:
        """All continuations, in the order of `jobs`."""
        waiting = sorted(range(len(jobs)), key=lambda i: (len(jobs[i].ids), i))
        done: dict[tuple[int, int], Generation] = {}
        logits = torch.empty(0, 0)
        while waiting or self.rows.jobs:
            if waiting and len(self.rows.jobs) <= self.capacity * 3 // 4:
                logits = self._admit(jobs, waiting, logits)
            tokens = self._choose(logits)
            tokens = self._retire(tokens, done)
            if len(tokens):
                logits = self.decoder.feed(0, tokens[:, None], torch.ones_like(tokens))
        return [done[job.prompt, job.draw] for job in jobs]

    def _admit(self, jobs: Sequence[Job], waiting: list[int], logits: Tensor) -> Tensor:
        """Fill the free rows with the longest waiting prompts; the logits of all active rows."""
        first = len(self.rows.jobs)
        count = min(self.capacity - first, len(waiting))
        new = [jobs[waiting.pop()] for _ in range(count)]
        self.rows.jobs.extend(new)
        self.rows.made[first : first + count] = 0
        self.rows.score[first : first + count] = 0
        for row, job in enumerate(new, first):
            self.rows.uniform[row] = uniforms(self.seed, job.prompt, job.draw, self.limits.max_new)
        self.decoder.clear(first, count)
        fresh = self.decoder.feed(first, *pad([job.ids for job in new], self.device))
        return torch.cat([logits, fresh]) if first else fresh

    def _choose(self, logits: Tensor) -> Tensor:
        """The next token of each active row, noted in its row."""
        n = len(self.rows.jobs)
        made, every = self.rows.made[:n], torch.arange(n)
        tokens = self.choose(logits, self.rows.uniform[every, made].to(logits.device))
        if self.score:
            chosen = logits.float().log_softmax(-1).gather(-1, tokens[:, None]).squeeze(-1)
            self.rows.score[:n] += chosen.double().cpu()
        self.rows.tokens[every, made] = tokens.cpu()
        made += 1
        return tokens

    def _retire(self, tokens: Tensor, done: dict[tuple[int, int], Generation]) -> Tensor:
        """Take the finished rows out and close the ranks; the tokens of the rows that go on."""
        n = len(self.rows.jobs)
        full = self.decoder.lengths[:n] >= self.decoder.context
        ended = (tokens == self.limits.stop) | full | (self.rows.made[:n] >= self.limits.max_new).to(self.device)
        if self.limits.pause is not None:
            ended |= (tokens == self.limits.pause) & (self.rows.made[:n] > 1).to(self.device)
        if not bool(ended.any()):
            return tokens
        for row in ended.nonzero()[:, 0].tolist():
            self._report(self.rows.take(row, self.limits), done)
        return self._compact(tokens, ended)

    def _report(self, made: Generation, done: dict[tuple[int, int], Generation]) -> None:
        done[made.prompt, made.draw] = made
        if self.on_done is not None:
            self.on_done(made)

    def _compact(self, tokens: Tensor, ended: Tensor) -> Tensor:
        """Move the last going rows into the holes; the order of rows does not matter."""
        going = (~ended).nonzero()[:, 0]
        left = len(going)
        sources, targets = going[going >= left], ended[:left].nonzero()[:, 0]
        self.decoder.move(sources, targets)
        self.decoder.clear(left, len(ended) - left)
        self.rows.move(sources.tolist(), targets.tolist())
        tokens[targets] = tokens[sources]
        del self.rows.jobs[left:]
        return tokens[:left]


def pad(texts: Sequence[Sequence[int]], device: torch.device) -> tuple[Tensor, Tensor]:
    """Token ids padded to the right (n, longest) and their lengths (n)."""
    counts = torch.tensor([len(ids) for ids in texts], dtype=torch.long)
    padded = torch.zeros(len(texts), int(counts.max()), dtype=torch.long)
    for row, ids in enumerate(texts):
        padded[row, : len(ids)] = torch.as_tensor(ids, dtype=torch.long)
    return padded.to(device), counts.to(device)


def run_jobs(jobs: Sequence[Job], make_loop: Callable[[], Runs], workers: int = 1) -> list[Generation]:
    """All continuations in the order of `jobs`, the work split over `workers` threads of one core each.

    Two threads with a matrix each beat one matrix split over two: operations this small spend more time at the barrier.
    """
    if workers <= 1 or len(jobs) < 2 * workers:
        return make_loop().run(jobs)
    order = sorted(range(len(jobs)), key=lambda i: len(jobs[i].ids))
    parts = [[jobs[i] for i in order[w::workers]] for w in range(workers)]
    with ThreadPoolExecutor(workers, initializer=torch.set_num_threads, initargs=(1,)) as pool:
        made = [g for part in pool.map(lambda part: make_loop().run(part), parts) for g in part]
    by_key = {(g.prompt, g.draw): g for g in made}
    return [by_key[job.prompt, job.draw] for job in jobs]
