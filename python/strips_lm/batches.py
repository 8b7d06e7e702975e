"""From tokenized pairs to batches: order by (seed, epoch), steps that mix lengths, batches of like length.

An epoch is one permutation of the records, a pure function of (seed, epoch). It is cut into steps of `step_tokens`
scored and unscored tokens (or of `step_pairs` pairs); the records of a step are sorted by length and cut into
batches of at most `batch_tokens` padded tokens, and every process takes each `world`-th row of a batch. A step mixes
all lengths on purpose: steps of one length each have no padding, but learn half as fast a token
(docs/experiments.md). What a record looks like (slots renumbered or given names, position offset, whether its negative
comes along) is a function of (seed, epoch, record), so that a run can go on from any step without any other state. This
module knows numbers, not text.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
import torch

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from numpy.typing import NDArray
    from torch import Tensor

    from strips_lm.dataset import PlanDataset, StepPool
    from strips_lm.goal_targets import GoalReader, GoalTargets
    from strips_lm.spelling import Spelling


@dataclass(frozen=True, slots=True, kw_only=True)
class Batch:
    """Rows padded on the right, and which of their positions the losses read."""

    input_ids: Tensor
    """(rows, length) token ids, or flat (tokens,) where there are several blocks."""
    position_ids: Tensor
    """Positions in the same shape, each row from its own offset on."""
    blocks: tuple[tuple[int, int], ...]
    """(rows, length) of the tables that the tokens are laid out in, one behind the other."""
    borrowed: tuple[int, ...] = ()
    """How many tokens each row has before its own: the first of the last row before it that borrows none."""
    lm_positions: Tensor
    """(scored,) flat indices into the tokens of the positions that predict a scored token."""
    lm_labels: Tensor
    """(scored,) the tokens they should predict."""
    mc_token_ids: Tensor
    """(pairs, choices) flat indices of each choice's last token; the positive comes first."""
    mc_labels: Tensor
    """(pairs,) which choice is the positive: always 0."""
    goal: GoalTargets | None = None
    """What the layers are told of goals, if anything; places are flat indices into the tokens."""

    def to(self, device: torch.device) -> Batch:
        """The same batch on another device."""
        parts = {field.name: getattr(self, field.name) for field in fields(self)}
        moved: dict[str, Any] = {name: part.to(device) for name, part in parts.items() if torch.is_tensor(part)}
        goal = None if self.goal is None else self.goal.to(device)
        return replace(self, **moved, goal=goal)


@dataclass(frozen=True, slots=True)
class Row:
    """One token sequence: prompt and completion, and how it takes part in the losses."""

    prompt: NDArray[np.integer]
    completion: NDArray[np.integer]
    scored: bool
    """Whether its completion's tokens count in the LM loss (positives only)."""
    offset: int = 0
    """Position of its first token."""

    def __len__(self) -> int:
        return len(self.prompt) + len(self.completion)

    @property
    def tokens(self) -> NDArray[np.integer]:
        """All of them."""
        return np.concatenate((self.prompt, self.completion))


READ_TOKENS = 8192
"""Padded tokens that go through a model at once where it only reads."""


def padded_parts(lengths: Sequence[int], most: int = READ_TOKENS) -> list[list[int]]:
    """Indices of rows, those of like length together, in parts of at most `most` padded tokens (or of a single row)."""
    parts: list[list[int]] = []
    for index in np.argsort(lengths, kind="stable").tolist():
        if not parts or (len(parts[-1]) + 1) * lengths[index] > most:
            parts.append([])
        parts[-1].append(index)
    return parts


def collate(
    rows: Sequence[Row],
    pairs: Sequence[Sequence[int]],
    pad: int,
    spread: float = math.inf,
    *,
    borrow: bool = False,
    reader: GoalReader | None = None,
) -> Batch:
    """Lay out rows in blocks and index what the losses read; `pairs` lists the rows of each choice, positive first.

    A block's rows differ in length by at most the share `spread`, and are padded to its longest. With `borrow` nothing
    is padded, rows stay in order, and of a negative right behind its positive only what differs is laid out. With a
    `reader` the layers are told of goals.
    """
    borrowed = _borrowed(rows, pairs) if borrow else [0] * len(rows)
    lengths = np.array([len(row) - known for row, known in zip(rows, borrowed, strict=True)])
    order = np.arange(len(rows)) if borrow else np.argsort(lengths, kind="stable")
    blocks = tuple((1, int(length)) for length in lengths) if borrow else _blocks(lengths[order], spread)
    widths = np.repeat([length for _, length in blocks], [count for count, _ in blocks])
    starts = np.empty(len(rows), dtype=np.int64)
    starts[order] = np.cumsum(widths) - widths
    ids = np.full(int(widths.sum()), pad, dtype=np.int64)
    firsts = [rows[index].offset + borrowed[index] for index in order]
    places = np.concatenate([np.arange(width) + first for first, width in zip(firsts, widths, strict=True)])
    scored, labels = [], []
    for start, row, known, length in zip(starts, rows, borrowed, lengths, strict=True):
        ids[start : start + length] = row.tokens[known:]
        if row.scored:
            scored.append(np.arange(start + len(row.prompt) - 1, start + length - 1))
            labels.append(row.completion)
    shape = blocks[0] if len(blocks) == 1 else (-1,)
    last = [[int(starts[row] + lengths[row]) - 1 for row in pair] for pair in pairs]
    return Batch(
        input_ids=torch.from_numpy(ids).view(shape),
        position_ids=torch.from_numpy(places).view(shape),
        blocks=blocks,
        borrowed=tuple(borrowed) if any(borrowed) else (),
        lm_positions=_long(scored),
        lm_labels=_long(labels),
        mc_token_ids=torch.tensor(last, dtype=torch.long).reshape(len(pairs), -1 if pairs else 0),
        mc_labels=torch.zeros(len(pairs), dtype=torch.long),
        goal=_goal_targets(rows, starts, reader) if reader is not None else None,
    )


def _goal_targets(rows: Sequence[Row], starts: NDArray[np.int64], reader: GoalReader) -> GoalTargets | None:
    """What the layers are told of a batch's goals; scored rows lie whole in its tokens."""
    scored = [index for index, row in enumerate(rows) if row.scored]
    return reader.targets([rows[index].tokens for index in scored], starts[scored].tolist()) if scored else None


def _borrowed(rows: Sequence[Row], pairs: Sequence[Sequence[int]]) -> list[int]:
    """How many tokens each row need not bring, as it begins like the first of its pair, right behind which it comes."""
    borrowed = [0] * len(rows)
    for first, *others in pairs:
        lender = rows[first].tokens
        for place, other in enumerate(others, first + 1):
            row = rows[other]
            if other != place or row.scored or row.offset != rows[first].offset:
                break
            most = min(len(lender), len(row) - 1)  # One token is the row's own, for the second head to read.
            unlike = np.flatnonzero(lender[:most] != row.tokens[:most])
            borrowed[other] = int(unlike[0]) if len(unlike) else most
            if not borrowed[other]:
                break  # The next one would borrow from this row.
    return borrowed


def _blocks(lengths: NDArray[np.int64], spread: float) -> tuple[tuple[int, int], ...]:
    """(rows, length) of each block, for rows sorted by length."""
    blocks = []
    start = 0
    while start < len(lengths):
        end = int(np.searchsorted(lengths, lengths[start] * (1.0 + spread), side="right"))
        blocks.append((end - start, int(lengths[end - 1])))
        start = end
    return tuple(blocks)


def _long(parts: Sequence[NDArray[np.integer]]) -> Tensor:
    return torch.from_numpy(np.concatenate(parts).astype(np.int64)) if parts else torch.zeros(0, dtype=torch.long)


@dataclass(frozen=True, slots=True)
class Plan:
    """How an epoch is cut: what each step holds, in positions of the data set."""

    step_tokens: int
    """Tokens (prompts and positives) of a step, unless `step_pairs` counts records."""
    step_pairs: int
    """Records of a step; 0 counts tokens."""
    batch_tokens: int
    """Padded tokens that go through the model at once."""
    spread: float = math.inf
    """How much longer, as a share, the longest row of a block may be than its shortest."""
    borrow: bool = False
    """Whether nothing is padded and a negative borrows what it has in common with its positive."""


@dataclass(frozen=True, slots=True)
class Dress:
    """How records are varied each time they are shown."""

    mc_share: float = 0.0
    """Share of the records that bring their negative."""
    renumber_share: float = 0.0
    """Share of the records whose object slots get random increasing numbers."""
    offset: int = 0
    """Largest random start position."""
    offset_share: float = 1.0
    """Share of the records that start at a random position; the others start at 0."""
    short_names: float = 0.0
    """Share of the names drawn for slots that have one piece; read where the data set has a `spelling`."""
    named_share: float = 0.0
    """Share of the records that keep their own names where the data set has a `spelling` and those."""


@dataclass(frozen=True, slots=True)
class Step:
    """One optimisation step: this process's batches, and what all processes' batches sum over."""

    batches: list[Batch]
    records: NDArray[np.int64]
    """The step's records, as numbers in the `PlanDataset`, over all processes."""
    tokens: int
    """Scored tokens of the step, over all processes."""
    pairs: int
    """Pairs of the step, over all processes."""
    seen: int
    """Tokens of the step's rows without padding, over all processes; shared ones count in each row that has them."""
    drawn: int = 1
    """Steps' worth of records that the step's were selected from."""


def epoch_order(data: PlanDataset, plan: Plan, seed: int, epoch: int) -> list[NDArray[np.int64]]:
    """The records of each step of an epoch: a function of (data, plan, seed, epoch) alone."""
    return _cut(np.random.default_rng((seed, epoch, 0)).permutation(data.kept), data.lengths, plan)


def _cut(records: NDArray[np.int64], lengths: NDArray[np.int64], plan: Plan) -> list[NDArray[np.int64]]:
    if plan.step_pairs:
        return [records[start : start + plan.step_pairs] for start in range(0, len(records), plan.step_pairs)]
    totals = np.cumsum(lengths[records])
    bounds = np.searchsorted(totals, np.arange(plan.step_tokens, totals[-1], plan.step_tokens), side="right")
    return [part for part in np.split(records, bounds) if len(part)]


def build_step(
    data: PlanDataset,
    records: NDArray[np.int64],
    plan: Plan,
    dress: Dress,
    seed: Sequence[int],
    *,
    rank: int = 0,
    world: int = 1,
    select: Select | None = None,
) -> Step:
    """The batches of one step for process `rank` of `world`; `seed` fixes every random choice in it.

    With `select` the step is made of those of the dressed records that it picks.
    """
    records = records[np.argsort(data.lengths[records], kind="stable")]
    groups = _dress(data, records, dress, np.random.default_rng(tuple(seed)))
    if data.spelling is not None:
        order = np.argsort([max(map(len, group)) for group in groups], kind="stable")
        groups, records = [groups[place] for place in order], records[order]
    if select is not None:
        picked = select(groups, records)
        groups, records = [groups[place] for place in picked], records[picked]
    cuts = cut_batches(groups, plan.batch_tokens)
    return Step(
        batches=[share_batch(cut, data.pad, plan, rank, world, reader=data.goal_reader) for cut in cuts],
        records=records,
        tokens=sum(len(group[0].completion) for group in groups),
        pairs=sum(len(group) > 1 for group in groups),
        seen=sum(len(row) for group in groups for row in group),
    )


Group = tuple[Row, ...]
"""A positive, and its negative where it comes along, or two steps for the second head; the last two rows are a pair."""

Select: TypeAlias = "Callable[[Sequence[Group], NDArray[np.int64]], NDArray[np.int64]]"
"""Of dressed records and their numbers, the places of those that a step is made of, ascending."""


def _dress(data: PlanDataset, records: NDArray[np.int64], dress: Dress, rng: np.random.Generator) -> list[Group]:
    """The rows of each record, varied; draws are made for all records whether or not they are used."""
    offsets = _offsets(len(records), dress, rng)
    paired = rng.random(len(records)) < dress.mc_share
    renumbered = rng.random(len(records)) < dress.renumber_share
    if data.spelling is not None:
        dressed = [_name(data, data.spelling, record, dress, rng) for record in records]
    else:
        dressed = [data.parts(record) for record in records]
        _renumber_some(dressed, renumbered, data.slots, rng)
    own = iter(_own_steps(data, data.own_steps, int(paired.sum()), dress, rng)) if data.own_steps is not None else None
    groups: list[Group] = []
    for parts, offset, pair in zip(dressed, offsets, paired, strict=True):
        positive = Row(parts[0], parts[1], scored=True, offset=int(offset))
        if not pair:
            groups.append((positive,))
        elif own is not None:
            groups.append((positive, *next(own)))
        else:
            groups.append((positive, Row(parts[0], parts[2], scored=False, offset=int(offset))))
    return groups


def _own_steps(
    data: PlanDataset, pool: StepPool, count: int, dress: Dress, rng: np.random.Generator
) -> Iterator[tuple[Row, Row]]:
    """So many pairs of a right step and a wrong one, each with its own prompt, varied like records."""
    numbers = np.concatenate((rng.choice(pool.right, count), rng.choice(pool.wrong, count)))
    offsets = _offsets(2 * count, dress, rng)
    renumbered = rng.random(2 * count) < dress.renumber_share
    dressed = [[pool.prompts[number], pool.steps[number]] for number in numbers]
    if data.spelling is not None:
        dressed = [data.spelling.spell(parts, rng, dress.short_names) for parts in dressed]
    else:
        _renumber_some(dressed, renumbered, data.slots, rng)
    rows = [
        Row(prompt, step, scored=False, offset=int(offset))
        for (prompt, step), offset in zip(dressed, offsets, strict=True)
    ]
    return zip(rows[:count], rows[count:], strict=True)


def _name(
    data: PlanDataset, spelling: Spelling, record: int, dress: Dress, rng: np.random.Generator
) -> list[NDArray[np.integer]]:
    """A record's parts with its own names, if that is its lot and there is room for them, or with drawn ones."""
    if data.named is not None and rng.random() < dress.named_share:
        parts = data.named.parts(record)
        if spelling.fits(parts):
            return parts
    return spelling.spell(data.parts(record), rng, dress.short_names)


def _offsets(count: int, dress: Dress, rng: np.random.Generator) -> NDArray[np.int64]:
    """Start positions, 0 for those that do not get a random one."""
    offsets = rng.integers(dress.offset + 1, size=count)
    offsets[rng.random(count) >= dress.offset_share] = 0
    return offsets


def _renumber_some(
    dressed: list[list[NDArray[np.integer]]],
    chosen: NDArray[np.bool_],
    slots: Sequence[tuple[int, int]],
    rng: np.random.Generator,
) -> None:
    """Gives the chosen ones other slot numbers, where there are slots."""
    places = np.flatnonzero(chosen)
    if slots and len(places):
        for place, parts in zip(places, _renumber([dressed[i] for i in places], slots, rng), strict=True):
            dressed[place] = parts


def _renumber(
    records: Sequence[Sequence[NDArray[np.integer]]], slots: Sequence[tuple[int, int]], rng: np.random.Generator
) -> list[list[NDArray[np.integer]]]:
    """Maps each record's slots in use to random increasing slots of their block: one time in two any, else near."""
    parts = [part for record in records for part in record]
    flat = np.concatenate(parts)
    lengths = np.array([sum(map(len, record)) for record in records])
    owner = np.repeat(np.arange(len(records)), lengths)
    table = np.tile(np.arange(max(int(flat.max()) + 1, *(first + count for first, count in slots))), (len(records), 1))
    wide = rng.integers(2, size=len(records)) == 1
    spare = 4 if len(slots) == 1 else 2  # A block of one type holds fewer objects than one of all.
    for first, count in slots:
        inside = np.where((flat >= first) & (flat < first + count), flat.astype(np.int64) - first + 1, 0)
        used = np.maximum.reduceat(inside, np.cumsum(lengths) - lengths)
        row, number, slot = _subsets(used, np.where(wide, count, np.minimum(count, used + spare)), count, rng)
        table[row, first + number] = first + slot
    cuts = np.cumsum([len(part) for part in parts])[:-1]
    mapped = iter(np.split(table[owner, flat], cuts))
    return [[next(mapped) for _ in record] for record in records]


def _subsets(
    sizes: NDArray[np.int64], reaches: NDArray[np.int64], count: int, rng: np.random.Generator
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """For each row a random subset, of its size, of the numbers below its reach, which is at most `count`.

    Returns each member's row, its place in its subset and itself, ascending.
    """
    keys = rng.random((len(sizes), count))
    keys[np.arange(count) >= reaches[:, None]] = 2.0
    last = np.take_along_axis(np.sort(keys, axis=1), np.maximum(sizes - 1, 0)[:, None], axis=1)
    chosen = (keys <= last) & (sizes > 0)[:, None]
    row, member = np.nonzero(chosen)
    return row, (np.cumsum(chosen, axis=1) - 1)[row, member], member


def cut_batches(groups: Sequence[Group], batch_tokens: int) -> list[list[Group]]:
    """Cuts groups, in order, where the padded rows would pass `batch_tokens`."""
    cuts: list[list[Group]] = [[]]
    rows = longest = 0
    for group in groups:
        length = max(map(len, group))
        if cuts[-1] and (rows + len(group)) * max(longest, length) > batch_tokens:
            cuts.append([])
            rows = longest = 0
        cuts[-1].append(group)
        rows, longest = rows + len(group), max(longest, length)
    return cuts


def share_batch(
    groups: Sequence[Group], pad: int, plan: Plan, rank: int = 0, world: int = 1, *, reader: GoalReader | None = None
) -> Batch:
    """One process's rows of a batch; where it has none, a row that no loss reads keeps the processes in step."""
    mine = groups[rank::world] or [(Row(groups[0][0].prompt, groups[0][0].completion, scored=False),)]
    rows: list[Row] = []
    pairs: list[range] = []
    for group in mine:
        rows.extend(group)
        if len(group) > 1:
            pairs.append(range(len(rows) - 2, len(rows)))
    return collate(rows, pairs, pad, plan.spread, borrow=plan.borrow, reader=reader)


def walk(data: PlanDataset, plan: Plan, seed: int, start: int = 0) -> Iterator[tuple[int, NDArray[np.int64]]]:
    """(step number, its records) from step `start` on, epoch after epoch, without end."""
    epoch, passed = 0, 0
    while True:
        steps = epoch_order(data, plan, seed, epoch)
        for index in range(max(start - passed, 0), len(steps)):
            yield passed + index, steps[index]
        passed += len(steps)
        epoch += 1
