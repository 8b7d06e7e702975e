"""Training on names that are drawn anew: rows stay whole, runs resume bit for bit, a checkpoint reads any name."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
import torch
from safetensors.torch import load_file

import blocks_data
from strips_lm.batches import Dress, Plan, build_step
from strips_lm.config import RunConfig
from strips_lm.dataset import texts
from strips_lm.generate import Planner
from strips_lm.prepare import _open
from strips_lm.tokenizer import SpelledTokenizer
from strips_lm.train import train
from test_train import interrupt_at

torch.set_num_threads(1)

DOMAIN = "(define (domain blocks) (:predicates (on ?x ?y)) (:action move :parameters (?x ?y) :effect (on ?x ?y)))"
SMALL = ("tokenizer.vocab_size=320", "model.layers=2", "model.width=32", "model.context=400", "train.minutes=0")
RUN = ("train.steps=12", "train.step_tokens=400", "train.mc_start=0.5", "train.validation_records=20")


def config(*more):
    return RunConfig.load("spelled", [*SMALL, *RUN, *more])


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = blocks_data.write(tmp_path_factory.mktemp("blocks"), train=200, validation=20)
    (folder / "domain.pddl").write_text(DOMAIN)
    return folder


@pytest.fixture(scope="module")
def opened(folder):
    tokenizer = SpelledTokenizer.of_data(folder, texts(folder), 320)
    return tokenizer, *_open(config(), folder, tokenizer)


def rows_of(step):
    """Each row of a step's batches as (tokens, positions), without padding."""
    for batch in step.batches:
        ids, places, start = batch.input_ids.view(-1), batch.position_ids.view(-1), 0
        for count, length in batch.blocks:
            for _ in range(count):
                yield ids[start : start + length], places[start : start + length]
                start += length


def test_a_pair_shares_its_names_and_no_two_showings_do(opened):
    tokenizer, training, _ = opened
    plan, dress = Plan(step_tokens=400, step_pairs=0, batch_tokens=2000), Dress(mc_share=1.0, offset=96)
    after = {tokenizer.hf.convert_tokens_to_ids("<ACTION>"), tokenizer.end_id}
    shown = []
    for seed in range(2):
        step = build_step(training, training.kept[:30], plan, dress, (seed, 1))
        rows = list(rows_of(step))
        assert len(rows) == 60
        assert all(int(ids.max()) < tokenizer.vocab_size and int(places.max()) < 400 for ids, places in rows)
        shown.append(sorted(tuple(ids.tolist()) for ids, _ in rows))
        prompts = [tuple(itertools.takewhile(lambda token: token not in after, ids.tolist())) for ids, _ in rows]
        assert sorted(map(prompts.count, prompts)) == [2] * 60
    assert shown[0] != shown[1]


def test_the_datas_own_names_can_be_kept(folder, opened):
    tokenizer, _, _ = opened
    training, _ = _open(config("train.drawn_names=0"), folder, tokenizer)
    plan = Plan(step_tokens=400, step_pairs=0, batch_tokens=2000)
    step = build_step(training, training.kept[:1], plan, Dress(short_names=1.0), (0, 1))
    ((ids, _),) = rows_of(step)
    text = list(texts(folder))[int(training.kept[0])]
    _, legends = tokenizer.encode_prompts([text])
    assert tokenizer.decode([ids.tolist()], legends) == [text]


def test_drawn_and_own_names_come_in_the_asked_shares(folder, opened):
    tokenizer, _, _ = opened
    training, _ = _open(config("train.drawn_names=0.5"), folder, tokenizer)
    plan, records = Plan(step_tokens=400, step_pairs=0, batch_tokens=4000, spread=0.0), training.kept[:100]
    own = {tuple(np.concatenate(training.named.parts(record)[:2]).tolist()) for record in records}

    def kept(share):
        dress = Dress(named_share=share)
        return sum(tuple(ids.tolist()) in own for ids, _ in rows_of(build_step(training, records, plan, dress, (0, 1))))

    assert kept(0.0) == 0
    assert 30 < kept(0.5) < 70
    assert kept(1.0) == 100


def test_own_names_without_room_give_way_to_drawn_ones(folder, opened):
    bytewise = SpelledTokenizer.of_data(folder, texts(folder), opened[0].first_piece + 266)
    training, _ = _open(config("train.drawn_names=0.5"), folder, bytewise)
    records = training.kept[:30]
    most = max(len(parts[0]) + max(map(len, parts[1:])) for parts in map(training.parts, records))
    training = replace(training, spelling=replace(training.spelling, most=most))
    assert not all(training.spelling.fits(training.named.parts(record)) for record in records)
    plan = Plan(step_tokens=400, step_pairs=0, batch_tokens=4000, spread=0.0)
    rows = rows_of(build_step(training, records, plan, Dress(named_share=1.0), (0, 1)))
    assert all(len(ids) <= most for ids, _ in rows)


def test_short_names_make_rows_as_long_as_their_slots(opened):
    _, training, _ = opened
    plan, dress = Plan(step_tokens=400, step_pairs=0, batch_tokens=2000), Dress(short_names=1.0)
    step = build_step(training, training.kept[:30], plan, dress, (0, 1))
    assert step.seen == int(training.lengths[training.kept[:30]].sum())


def test_a_resumed_run_ends_bit_for_bit_where_an_uninterrupted_one_does(folder, tmp_path, monkeypatch):
    train(config(), folder, tmp_path / "whole", shown=False)
    interrupt_at(5, monkeypatch)
    assert train(config(), folder, tmp_path / "pieced", shown=False) != 0
    monkeypatch.undo()
    assert train(config(), folder, tmp_path / "pieced", resumed=True, shown=False) == 0
    whole, pieced = (load_file(tmp_path / name / "last" / "model.safetensors") for name in ("whole", "pieced"))
    assert all(torch.equal(whole[name], pieced[name]) for name in whole)


def test_a_checkpoint_continues_prompts_about_any_names(folder, tmp_path):
    train(config(), folder, tmp_path, shown=False)
    planner = Planner.load(tmp_path, config().generate)
    prompts = [
        "<|startoftext|> <GOAL> on(ångström, table) <INIT> on(ångström, x9_y)",
        "<|startoftext|> <GOAL> on(b, c) <INIT> on(c, b)",
    ]
    assert len(planner.complete(prompts, "greedy").completions) == 2
