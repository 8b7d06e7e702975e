"""Beam search over a decoder: the `width` likeliest continuations of each prompt are kept at every step.

A finished continuation's score is its log-probability divided by length^penalty, as in transformers; a prompt is done
when no going beam can still beat its `width` finished ones. Price: `width` rows a prompt, and one reordering of the
cache a step. It knows token ids alone.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import torch

from strips_lm.decode.loop import Generation, pad

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from torch import Tensor

    from strips_lm.decode.loop import Decoder, Job, Limits


@dataclass(slots=True)
class _Beams:
    """One prompt's beams: parallel lists of tokens and log-probabilities, and the finished ones with their scores."""

    job: Job
    tokens: list[list[int]] = field(default_factory=lambda: [[]])
    scores: list[float] = field(default_factory=lambda: [0.0])
    finished: list[tuple[float, list[int], bool, float]] = field(default_factory=list)

    def end(self, tokens: list[int], score: float, penalty: float, stopped: bool) -> None:
        """Keep a finished continuation."""
        self.finished.append((score / len(tokens) ** penalty, tokens, stopped, score))

    def settled(self, width: int, penalty: float) -> bool:
        """Whether no going beam can end better than the worst of the `width` finished ones."""
        if len(self.finished) < width:
            return not self.tokens
        worst = sorted(item[0] for item in self.finished)[-width]
        return not self.tokens or self.scores[0] / len(self.tokens[0]) ** penalty <= worst

    def best(self) -> Generation:
        """The finished continuation with the best score."""
        _, tokens, stopped, score = max(self.finished, key=lambda item: item[0])
        return Generation(self.job.prompt, self.job.draw, tokens, stopped, score)


@torch.inference_mode()
def beam_search(
    jobs: Sequence[Job],
    make: Callable[[int], Decoder],
    limits: Limits,
    *,
    width: int = 4,
    penalty: float = 1.0,
    rows: int = 64,
) -> list[Generation]:
    """The best continuation of each job, in order; `make(rows)` gives a decoder."""
    order = sorted(range(len(jobs)), key=lambda i: len(jobs[i].ids))
    done: dict[int, Generation] = {}
    group = max(1, rows // width)
    for start in range(0, len(order), group):
        part = order[start : start + group]
        found = _search(Group([jobs[i] for i in part], make(len(part) * width), limits, width, penalty))
        done.update(zip(part, found, strict=True))
    return [done[i] for i in range(len(jobs))]


@dataclass(slots=True)
class Group:
    """Prompts that are searched together, and how."""

    jobs: list[Job]
    decoder: Decoder
    limits: Limits
    width: int
    penalty: float


def _search(group: Group) -> list[Generation]:
    """One group from its prompts to its best continuations."""
    beams = [_Beams(job) for job in group.jobs]
    logits = group.decoder.feed(0, *pad([job.ids for job in group.jobs], group.decoder.lengths.device))
    going = beams
    for made in range(1, group.limits.max_new + 1):
        parents, tokens = _extend(group, going, logits.float().log_softmax(-1), made)
        going = [beam for beam in going if beam.tokens]
        if not tokens:
            break
        device = group.decoder.lengths.device
        source = torch.tensor(parents, device=device)
        group.decoder.move(source, torch.arange(len(parents), device=device))
        fresh = torch.tensor(tokens, device=device)
        logits = group.decoder.feed(0, fresh[:, None], torch.ones_like(fresh))
    return [beam.best() for beam in beams]


def _extend(group: Group, going: list[_Beams], log_probs: Tensor, made: int) -> tuple[list[int], list[int]]:
    """Every prompt's next beams; for each row of the next step its parent row and its token."""
    parents: list[int] = []
    tokens: list[int] = []
    row = 0
    for beam in going:
        count = len(beam.tokens)
        kept = _grow(group, beam, log_probs[row : row + count])
        last = made >= group.limits.max_new or int(group.decoder.lengths[row]) >= group.decoder.context
        if last:
            for text, score in zip(beam.tokens, beam.scores, strict=True):
                beam.end(text, score, group.penalty, stopped=False)
        if last or beam.settled(group.width, group.penalty):
            beam.tokens, beam.scores = [], []
        else:
            parents.extend(row + parent for parent in kept)
            tokens.extend(text[-1] for text in beam.tokens)
        row += count
    return parents, tokens


def _grow(group: Group, beam: _Beams, log_probs: Tensor) -> list[int]:
    """Put the best `width` that go on into `beam`, and those that stop among its finished; the parents."""
    totals = log_probs + torch.tensor(beam.scores, device=log_probs.device)[:, None]
    best = totals.flatten().topk(min(2 * group.width, totals.numel()))
    texts: list[list[int]] = []
    scores: list[float] = []
    parents: list[int] = []
    for rank, (score, index) in enumerate(zip(best.values.tolist(), best.indices.tolist(), strict=True)):
        parent, token = divmod(index, totals.shape[-1])
        text = [*beam.tokens[parent], token]
        if token == group.limits.stop:
            if rank < group.width:
                beam.end(text, score, group.penalty, stopped=True)
        elif len(texts) < group.width and score > -torch.inf:
            texts.append(text)
            scores.append(score)
            parents.append(parent)
    beam.tokens, beam.scores = texts, scores
    return parents
