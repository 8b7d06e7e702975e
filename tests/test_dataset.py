"""Token arrays on disk, and how an epoch is cut and dressed."""

import numpy as np
import pytest

import blocks_data
from strips_lm.batches import Dress, Plan, build_step, epoch_order, walk
from strips_lm.dataset import DataSetError, PlanDataset, Ragged, entropy_floor, open_split, texts
from strips_lm.tokenizer import BpeTokenizer

PLAN = Plan(step_tokens=1500, step_pairs=0, batch_tokens=4000)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return blocks_data.write(tmp_path_factory.mktemp("blocks"))


@pytest.fixture(scope="module")
def tokenizer(folder):
    return BpeTokenizer.train(texts(folder), 320)


@pytest.fixture(scope="module")
def data(folder, tokenizer):
    return open_split(folder, "train", tokenizer, 512)


def test_arrays_hold_every_record_in_order(folder, tokenizer, data):
    wanted = [*blocks_data_texts(folder)]
    decoded = tokenizer.decode([np.concatenate((data.prompts[i], data.positives[i])) for i in range(400)], [None] * 400)
    assert decoded == wanted
    assert data.index.tolist() == list(range(400))


def blocks_data_texts(folder):
    return texts(folder, limit=10_000)


def test_tokens_are_made_once(folder, tokenizer, data, monkeypatch):
    monkeypatch.setattr(BpeTokenizer, "encode_records", None)
    again = open_split(folder, "train", tokenizer, 512)
    assert np.array_equal(again.positives.tokens, data.positives.tokens)
    assert isinstance(again.positives.tokens.base, np.memmap)


def test_other_data_or_tokenizer_make_other_arrays(folder, tokenizer):
    open_split(folder, "validation", tokenizer, 512)
    before = set((folder / "tokens").iterdir())
    open_split(folder, "validation", BpeTokenizer.train(texts(folder), 330), 512)
    assert len(set((folder / "tokens").iterdir()) - before) == 1


def test_records_too_long_are_left_out_and_counted(folder, tokenizer, data):
    lengths = data.prompts.lengths + np.maximum(data.positives.lengths, data.negatives.lengths)
    limit = int(np.median(lengths))
    short = open_split(folder, "train", tokenizer, limit)
    assert len(short) == int((lengths <= limit).sum())
    assert short.left_out == 400 - len(short)
    assert len(open_split(folder, "train", tokenizer, limit + 10, room=10)) == len(short)
    seen = {i for _, part in zip(range(20), (r for _, r in walk(short, PLAN, 0)), strict=False) for i in part}
    assert max(lengths[sorted(seen)]) <= limit


def test_missing_split_says_so(folder, tokenizer):
    with pytest.raises(DataSetError, match="no data/nowhere"):
        open_split(folder, "nowhere", tokenizer, 512)
    with pytest.raises(DataSetError, match="fits 3 positions"):
        open_split(folder, "train", tokenizer, 3)


def test_an_epoch_shows_every_record_once_and_depends_on_seed_and_epoch_alone(data):
    first = epoch_order(data, PLAN, 1, 0)
    assert sorted(np.concatenate(first).tolist()) == list(range(400))
    assert all(np.array_equal(a, b) for a, b in zip(first, epoch_order(data, PLAN, 1, 0), strict=True))
    assert not np.array_equal(np.concatenate(first), np.concatenate(epoch_order(data, PLAN, 1, 1)))
    assert max(data.lengths[part].sum() for part in first) <= PLAN.step_tokens + data.lengths.max()


def test_a_walk_goes_on_from_any_step(data):
    whole = [records for _, records in zip(range(80), (r for _, r in walk(data, PLAN, 3)), strict=False)]
    later = walk(data, PLAN, 3, start=70)
    for number in range(70, 80):
        step, records = next(later)
        assert step == number
        assert np.array_equal(records, whole[number])


def test_steps_of_pairs_hold_that_many(data):
    steps = epoch_order(data, Plan(step_tokens=1, step_pairs=4, batch_tokens=4000), 0, 0)
    assert {len(part) for part in steps} == {4}


def test_batches_of_a_step_waste_little(data):
    plan = Plan(step_tokens=8000, step_pairs=0, batch_tokens=2000)
    steps = [build_step(data, records, plan, Dress(), (0,)) for records in epoch_order(data, plan, 0, 0)]
    padded = sum(batch.input_ids.numel() for step in steps for batch in step.batches)
    assert padded < 1.3 * data.lengths.sum()


def test_every_step_mixes_lengths(data):
    plan = Plan(step_tokens=3000, step_pairs=0, batch_tokens=2000)
    *steps, _ = epoch_order(data, plan, 0, 0)
    means = [data.lengths[records].mean() for records in steps]
    assert max(means) < 1.5 * min(means)


@pytest.mark.parametrize("world", [2, 3])
def test_processes_share_a_step(data, world):
    records = epoch_order(data, PLAN, 0, 0)[0]
    dress = Dress(mc_share=0.5)
    whole = build_step(data, records, PLAN, dress, (0,))
    parts = [build_step(data, records, PLAN, dress, (0,), rank=rank, world=world) for rank in range(world)]
    labels = sorted(label for part in parts for batch in part.batches for label in batch.lm_labels.tolist())
    assert labels == sorted(label for batch in whole.batches for label in batch.lm_labels.tolist())
    assert {part.tokens for part in parts} == {whole.tokens} == {len(labels)}
    assert sum(len(batch.mc_labels) for part in parts for batch in part.batches) == whole.pairs > 0


def test_small_batches_hold_the_same_rows(data):
    records = epoch_order(data, PLAN, 0, 0)[0]
    cut = build_step(data, records, Plan(1500, 0, 400), Dress(mc_share=1.0), (0,))
    assert len(cut.batches) > 2
    assert all(batch.input_ids.numel() <= 400 for batch in cut.batches)
    assert sum(len(batch.lm_labels) for batch in cut.batches) == cut.tokens


def slotted(length=6, first=10, count=8):
    """One record whose tokens are the slots 0, 1, 2 and others."""
    tokens = np.array([1, 10, 2, 11, 12, 3], dtype=np.uint16)[:length]
    ragged = Ragged(tokens, np.array([0, len(tokens)]))
    zero = np.zeros(1, dtype=np.int64)
    return PlanDataset(ragged, ragged, ragged, zero, np.zeros(1), zero, 0, ((first, count),))


def test_slots_are_renumbered_in_order_and_alike_in_a_record():
    data, seen = slotted(), set()
    for seed in range(300):
        step = build_step(data, data.kept, PLAN, Dress(1.0, renumber_share=0.7), (seed,))
        ids = step.batches[0].input_ids
        assert len({tuple(row) for half in (ids[:, :6], ids[:, 6:]) for row in half.tolist()}) == 1
        slots = ids[0, [1, 3, 4]].tolist()
        assert slots == sorted(set(slots))
        assert min(slots) >= 10
        assert max(slots) < 18
        assert ids[0, [0, 2, 5]].tolist() == [1, 2, 3]
        seen.add(tuple(slots))
    assert (10, 11, 12) in seen
    assert {slot for slots in seen for slot in slots} == set(range(10, 18))


def test_offsets_shift_positions_and_stay_in_range(data):
    records = epoch_order(data, PLAN, 0, 0)[0]
    batch = build_step(data, records, PLAN, Dress(offset=5), (0,)).batches[0]
    starts = batch.position_ids[:, 0]
    assert set(starts.tolist()) <= set(range(6))
    assert len(set(starts.tolist())) > 1
    assert bool((batch.position_ids - starts[:, None] == np.arange(batch.input_ids.shape[1])).all())


def test_the_floor_is_the_mean_entropy_of_the_plans():
    ragged = Ragged(np.zeros(10, dtype=np.uint16), np.array([0, 4, 10]))
    kept = np.arange(2)
    data = PlanDataset(ragged, ragged, ragged, kept, np.log([8.0, 2.0]), kept, 0, (0, 0))
    assert entropy_floor(data, 2) == pytest.approx(np.log(16.0) / 10)
