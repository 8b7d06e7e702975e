"""Records are selected by what is left to learn of them; the run stays exact in every other respect."""

import json

import numpy as np
import pytest
import torch
from accelerate import Accelerator

import blocks_data
from strips_lm import tokenizer as tokenizers
from strips_lm.batches import Dress, Plan, build_step
from strips_lm.dataset import open_data, texts
from strips_lm.model import make_model
from strips_lm.objective import Objective
from strips_lm.selection import Selection, hardest
from strips_lm.train import train
from test_train import KINDS, config, interrupt_at, weights

SELECTING = ("train.select_from=3", "train.select_start=0.25", "train.select_end=0.8")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return blocks_data.write(tmp_path_factory.mktemp("blocks"))


def loss_of(model, prompt, completion):
    """The obvious twin: one record alone through the model's own forward pass."""
    ids = torch.from_numpy(np.concatenate([prompt, completion]).astype(np.int64))[None]
    logits = model(ids).logits[0, len(prompt) - 1 : -1]
    return float(torch.nn.functional.cross_entropy(logits, ids[0, len(prompt) :], reduction="sum").detach())


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("spread", [0.1, float("inf")])
def test_a_step_is_made_of_the_records_with_the_highest_loss_above_their_floor(kind, spread, folder):
    settings = config(kind, 1, "model.dropout=0.0")
    words = tokenizers.make(settings.tokenizer, folder, texts(folder))
    data = open_data(folder, "train", words, settings.model.context)
    data.entropies[:] = np.random.default_rng(1).uniform(0.0, 5.0, len(data.entropies))
    model = make_model(settings.model, words, 0).double()
    plan = Plan(step_tokens=900, step_pairs=0, batch_tokens=700, spread=spread)
    select = Selection(Accelerator(cpu=True), Objective(model, torch.float64), data, plan)
    records = np.random.default_rng(2).permutation(data.kept)[:60]
    step = build_step(data, records, plan, Dress(mc_share=0.5), (0,), select=select)

    left = {int(i): loss_of(model.eval(), data.prompts[i], data.positives[i]) - data.entropies[i] for i in records}
    ranked = sorted(left, key=left.__getitem__, reverse=True)
    totals = np.cumsum([data.lengths[i] for i in ranked])
    assert set(step.records.tolist()) == set(ranked[: 1 + int((totals < plan.step_tokens).sum())])
    assert list(data.lengths[step.records]) == sorted(data.lengths[step.records])
    assert step.tokens == sum(len(data.positives[i]) for i in step.records)


def test_a_step_of_so_many_pairs_takes_the_highest_of_them():
    plan = Plan(step_tokens=1, step_pairs=2, batch_tokens=1)
    assert hardest(np.array([0.1, 3.0, -1.0, 3.0]), np.ones(4, dtype=np.int64), plan).tolist() == [1, 3]


@pytest.mark.parametrize("kind", KINDS)
def test_a_run_that_selects_resumes_bit_for_bit(kind, folder, tmp_path, monkeypatch):
    train(config(kind, 12, *SELECTING), folder, tmp_path / "whole", shown=False)
    for stop in (2, 5, 11):
        out = tmp_path / f"stopped-{stop}"
        interrupt_at(stop, monkeypatch)
        train(config(kind, 12, *SELECTING), folder, out, shown=False)
        monkeypatch.undo()
        assert train(config(kind, 12, *SELECTING), folder, out, resumed=True, shown=False) == 0
        whole, pieced = weights(tmp_path / "whole"), weights(out)
        assert all(torch.equal(whole[name], pieced[name]) for name in whole), stop
    stood = json.loads((tmp_path / "whole" / "last" / "trainer.json").read_text())
    assert (stood["step"], stood["drawn"]) == (12, 12 + 2 * 7)  # steps 3 to 9 of 12 are selected


def test_a_checkpoint_of_before_selection_goes_on(folder, tmp_path, monkeypatch):
    train(config("lm-head", 6, "train.select_from=1"), folder, tmp_path / "whole", shown=False)
    interrupt_at(3, monkeypatch)
    train(config("lm-head", 6, "train.select_from=1"), folder, tmp_path / "old", shown=False)
    monkeypatch.undo()
    file = tmp_path / "old" / "last" / "trainer.json"
    stood = json.loads(file.read_text())
    assert stood.pop("drawn") == 3
    file.write_text(json.dumps(stood))
    assert train(config("lm-head", 6, "train.select_from=1"), folder, tmp_path / "old", resumed=True, shown=False) == 0
    whole, pieced = weights(tmp_path / "whole"), weights(tmp_path / "old")
    assert all(torch.equal(whole[name], pieced[name]) for name in whole)
