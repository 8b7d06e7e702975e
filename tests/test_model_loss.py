"""The losses against a plain computation, one example at a time, in float64; and what they must not depend on."""

import math
from itertools import pairwise

import numpy as np
import pytest
import torch
from torch.nn import functional as F
from torch.nn.attention import varlen
from transformers import GPT2DoubleHeadsModel, GPT2LMHeadModel

from strips_lm import attention
from strips_lm.batches import Plan, Row, collate, share_batch
from strips_lm.loss import batch_losses, weighted
from strips_lm.lstm import LstmConfig, LstmLMHeadModel
from strips_lm.muon import MuonAdamW
from test_model_forward import gpt2

RNG = np.random.default_rng(0)
PAD = 0


def some_pairs(count=6, negatives=1):
    """(prompt, completions with the positive first) of different lengths."""

    def draw(low, high):
        return RNG.integers(1, 50, RNG.integers(low, high))

    return [(draw(3, 9), [draw(2, 9) for _ in range(1 + negatives)]) for _ in range(count)]


def pairs_alike(count=6, negatives=1):
    """Pairs whose negatives begin like the positive, for some tokens, for all of them, or for none."""
    pairs = []
    for number, (prompt, (positive, *others)) in enumerate(some_pairs(count, negatives)):
        shared = [RNG.integers(0, len(positive) + 1) for _ in others]
        kept = [np.concatenate((positive[:n], other)) for n, other in zip(shared, others, strict=True)]
        pairs.append((prompt, [positive, *([positive[:1], *kept[1:]] if number == 0 else kept)]))
    return pairs


def batch_of(pairs, choices=True, spread=math.inf, borrow=False):
    rows, groups = [], []
    for prompt, completions in pairs:
        taken = completions if choices else completions[:1]
        groups.append(range(len(rows), len(rows) + len(taken)))
        rows += [Row(prompt, ids, scored=index == 0) for index, ids in enumerate(taken)]
    return collate(rows, groups if choices else [], PAD, spread, borrow=borrow)


def slow_twin(model, pairs, lm_weight, mc_weight):
    """L by transformers' own forward pass, one sequence at a time, one token at a time."""
    lm, mc, scored = 0.0, 0.0, 0
    for prompt, completions in pairs:
        scores = []
        for index, completion in enumerate(completions):
            ids = torch.tensor(np.concatenate((prompt, completion)))[None]
            last = torch.tensor([ids.shape[1] - 1])
            out = model(ids, mc_token_ids=last)
            scores.append(out.mc_logits.reshape(()))
            for place in range(len(prompt), ids.shape[1]) if index == 0 else ():
                lm = lm - F.log_softmax(out.logits[0, place - 1], dim=-1)[ids[0, place]]
                scored += 1
        mc = mc - F.log_softmax(torch.stack(scores), dim=0)[0]
    return lm_weight * lm / scored + mc_weight * mc / len(pairs)


def total(model, batches, lm_weight=1.0, mc_weight=2.0):
    """The step's loss over several batches."""
    losses = [batch_losses(model, batch, torch.float64) for batch in batches]
    tokens, pairs = sum(part.tokens for part in losses), sum(part.pairs for part in losses)
    return sum(weighted(part, tokens, pairs, lm_weight, mc_weight) for part in losses)


@pytest.mark.parametrize("negatives", [1, 3])
def test_loss_and_gradient_equal_the_slow_twin(negatives):
    pairs = some_pairs(negatives=negatives)
    model = gpt2(GPT2DoubleHeadsModel).double()
    slow_twin(model, pairs, 1.0, 2.0).backward()
    wanted = {name: parameter.grad.clone() for name, parameter in model.named_parameters()}
    model.zero_grad()
    total(model, [batch_of(pairs)]).backward()
    for name, parameter in model.named_parameters():
        torch.testing.assert_close(parameter.grad, wanted[name], rtol=1e-6, atol=1e-9, msg=name)


@pytest.mark.parametrize("negatives", [1, 3])
@pytest.mark.parametrize("way", ["blocks", "flash"])
def test_loss_and_gradient_equal_the_slow_twin_where_beginnings_are_shared(negatives, way, monkeypatch):
    pairs = pairs_alike(negatives=negatives)
    model = gpt2(GPT2DoubleHeadsModel).double()
    slow_twin(model, pairs, 1.0, 2.0).backward()
    wanted = {name: parameter.grad.clone() for name, parameter in model.named_parameters()}
    model.zero_grad()
    batch = batch_of(pairs, borrow=True)
    assert batch.input_ids.numel() + sum(batch.borrowed) == sum(len(p) + len(c) for p, cs in pairs for c in cs)
    assert sum(batch.borrowed) >= sum(len(prompt) for prompt, _ in pairs) - 1
    monkeypatch.setattr(attention, "kernel", lambda *_: way)
    monkeypatch.setattr(varlen, "varlen_attn", attend_row_by_row)
    total(model, [batch]).backward()
    for name, parameter in model.named_parameters():
        torch.testing.assert_close(parameter.grad, wanted[name], rtol=1e-6, atol=1e-9, msg=name)


@pytest.mark.parametrize("dtype", [torch.float32, torch.bfloat16])
def test_the_binding_shares_beginnings_and_is_as_near_to_the_truth(dtype):
    pairs = pairs_alike(30, negatives=2)
    model = gpt2(GPT2DoubleHeadsModel)
    found = []
    for of, borrow in ((torch.float64, False), (dtype, False), (dtype, True)):
        model = model.to(torch.float64 if of == torch.float64 else torch.float32)
        model.zero_grad()
        losses = batch_losses(model, batch_of(pairs, spread=0.0, borrow=borrow), of)
        (losses.lm + losses.mc).backward()
        found.append([losses.lm.detach(), losses.mc.detach(), *(p.grad.clone() for p in model.parameters())])
    for exact, apart, shared in zip(*found, strict=True):
        assert float((shared - exact).norm()) <= 2.0 * float((apart - exact).norm()) + 1e-5 * float(exact.norm()) + 1e-6


@pytest.mark.parametrize("change", ["order", "offset", "scored"])
def test_a_row_borrows_only_from_the_positive_right_before_it(change):
    prompt, said, other = np.array([5, 6, 7]), np.array([8, 9]), np.array([8, 4])
    rows = [
        Row(prompt, said, scored=True),
        Row(prompt, other, scored=change == "scored", offset=int(change == "offset")),
    ]
    between = [Row(prompt, other, scored=False)] if change == "order" else []
    batch = collate([rows[0], *between, rows[1]], [[0, 1 + len(between)]], PAD, borrow=True)
    assert batch.borrowed == ()
    assert batch.input_ids.numel() == 10 + 5 * len(between)


def test_a_negative_that_borrows_brings_what_differs():
    rows = [Row(np.array([5, 6]), np.array([7, 8, 9]), scored=True, offset=3)]
    rows.append(Row(np.array([5, 6]), np.array([7, 4]), scored=False, offset=3))
    batch = collate(rows, [[0, 1]], PAD, borrow=True)
    assert batch.borrowed == (0, 3)
    assert batch.input_ids.tolist() == [5, 6, 7, 8, 9, 4]
    assert batch.position_ids.tolist() == [3, 4, 5, 6, 7, 6]
    assert batch.lm_positions.tolist() == [1, 2, 3]
    assert batch.mc_token_ids.tolist() == [[4, 5]]


@pytest.mark.parametrize("batches", [1, 3])
def test_steps_are_judged_one_by_one(batches):
    """A head that judges steps: each step's own cross-entropy, right or wrong, whatever stands beside it."""
    records, model = some_pairs(6), gpt2(GPT2DoubleHeadsModel).double()
    right, wrong = some_pairs(6, negatives=0), some_pairs(6, negatives=0)
    model.config.judges_steps = True
    groups = [
        [Row(*said, scored=index == 0) for index, said in enumerate([(prompt, said[0]), *steps])]
        for (prompt, said), *steps in zip(
            records, *([(p, s) for p, (s,) in pool] for pool in (right, wrong)), strict=True
        )
    ]
    cuts = [share_batch(groups[start::batches], PAD, Plan(1, 0, 1)) for start in range(batches)]
    total(model, cuts).backward()
    found = {name: parameter.grad.clone() for name, parameter in model.named_parameters()}
    model.zero_grad()
    slow_steps(model, records, right, wrong).backward()
    for name, parameter in model.named_parameters():
        torch.testing.assert_close(found[name], parameter.grad, rtol=1e-6, atol=1e-9, msg=name)


def slow_steps(model, records, right, wrong, lm_weight=1.0, mc_weight=2.0):
    """L where the second head judges steps, by transformers' own forward pass, one sequence at a time."""
    lm, mc, scored = 0.0, 0.0, 0
    for prompt, (said, *_) in records:
        ids = torch.tensor(np.concatenate((prompt, said)))[None]
        logits = model(ids, mc_token_ids=torch.tensor([0])).logits[0].log_softmax(-1)
        for place in range(len(prompt), ids.shape[1]):
            lm, scored = lm - logits[place - 1, ids[0, place]], scored + 1
    for holds, pool in ((True, right), (False, wrong)):
        for prompt, (step,) in pool:
            ids = torch.tensor(np.concatenate((prompt, step)))[None]
            chance = model(ids, mc_token_ids=torch.tensor([ids.shape[1] - 1])).mc_logits.sigmoid().reshape(())
            mc = mc - (chance if holds else 1 - chance).log()
    return lm_weight * lm / scored + mc_weight * mc / (2 * len(right))


@pytest.mark.parametrize("cut", [1, 2, 4])
def test_loss_does_not_depend_on_the_cut_into_batches(cut):
    pairs = some_pairs(7)
    model = gpt2(GPT2DoubleHeadsModel).double()
    parts = [batch_of(pairs[start : start + cut]) for start in range(0, len(pairs), cut)]
    torch.testing.assert_close(total(model, parts), total(model, [batch_of(pairs)]), rtol=1e-12, atol=0)


def test_loss_does_not_depend_on_order_or_padding():
    pairs = some_pairs(5)
    longer = [*pairs, (np.ones(30, dtype=int), [np.ones(5, dtype=int)] * 2)]
    model = gpt2(GPT2DoubleHeadsModel).double()
    alone, beside = batch_losses(model, batch_of(pairs), torch.float64), batch_of(longer)
    last = batch_losses(model, batch_of(longer[-1:]), torch.float64)
    both = batch_losses(model, beside, torch.float64)
    torch.testing.assert_close(both.lm, alone.lm + last.lm)
    torch.testing.assert_close(both.mc, alone.mc + last.mc)
    torch.testing.assert_close(total(model, [batch_of(pairs[::-1])]), total(model, [batch_of(pairs)]))


def test_prompts_and_negatives_get_no_lm_gradient():
    """The LM loss does not change with the logits of any position that does not predict a positive's token."""
    model = gpt2(GPT2DoubleHeadsModel).double()
    batch = batch_of(some_pairs(4))
    hidden = model.transformer(batch.input_ids).last_hidden_state.detach().requires_grad_()
    at = hidden.reshape(-1, hidden.shape[-1])[batch.lm_positions]
    F.cross_entropy(model.lm_head(at), batch.lm_labels, reduction="sum").backward()
    silent = torch.ones(batch.input_ids.numel(), dtype=torch.bool)
    silent[batch.lm_positions] = False
    grads = hidden.grad.reshape(-1, hidden.shape[-1])
    assert torch.count_nonzero(grads[silent]) == 0
    assert bool((grads[~silent].abs().sum(-1) > 0).all())


def test_scored_positions_are_the_positives_completions_and_end_token():
    pairs = [(np.array([5, 6]), [np.array([7, 8, 9]), np.array([3, 4])])]
    batch = batch_of(pairs)
    assert batch.lm_labels.tolist() == [7, 8, 9]
    assert batch.input_ids.tolist() == [[5, 6, 3, 4, PAD], [5, 6, 7, 8, 9]]
    assert batch.lm_positions.tolist() == [6, 7, 8]
    assert batch.mc_token_ids.tolist() == [[9, 3]]


def test_blocks_hold_rows_of_like_length_and_leave_loss_and_gradient_alone():
    pairs = some_pairs(8)
    whole, blocked = batch_of(pairs), batch_of(pairs, spread=0.2)
    assert len(blocked.blocks) > 1
    assert sum(rows for rows, _ in blocked.blocks) == 16
    assert blocked.input_ids.numel() < whole.input_ids.numel()
    model = gpt2(GPT2DoubleHeadsModel).double()
    grads = []
    for batch in (whole, blocked):
        model.zero_grad()
        total(model, [batch]).backward()
        grads.append({name: parameter.grad.clone() for name, parameter in model.named_parameters()})
    for name, grad in grads[0].items():
        torch.testing.assert_close(grads[1][name], grad, rtol=1e-9, atol=1e-10, msg=name)


def attend_row_by_row(query, key, value, bounds, _bounds, longest, _longest, *, scale, window_size):
    """The slow twin of PyTorch's `varlen_attn`."""
    assert window_size == (-1, 0)
    assert int(bounds[-1]) == len(query), "every token is of a row"
    assert longest >= int(bounds.diff().max())
    rows = [
        F.scaled_dot_product_attention(
            *(part[a:b].transpose(0, 1) for part in (query, key, value)), is_causal=True, scale=scale
        )
        for a, b in pairwise(bounds.tolist())
    ]
    return torch.cat([row.transpose(0, 1) for row in rows])


def test_rows_of_any_length_attend_as_padded_ones(monkeypatch):
    pairs = some_pairs(8)
    model = gpt2(GPT2DoubleHeadsModel).double()
    grads = []
    for spread in (math.inf, 0.0):
        if spread == 0.0:
            monkeypatch.setattr(attention, "kernel", lambda *_: "flash")
            monkeypatch.setattr(varlen, "varlen_attn", attend_row_by_row)
        batch = batch_of(pairs, spread=spread)
        model.zero_grad()
        total(model, [batch]).backward()
        grads.append({name: parameter.grad.clone() for name, parameter in model.named_parameters()})
    assert batch.input_ids.numel() == sum(len(p) + len(c) for p, completions in pairs for c in completions)
    for name, grad in grads[0].items():
        torch.testing.assert_close(grads[1][name], grad, rtol=1e-9, atol=1e-10, msg=name)


@pytest.mark.skipif(not torch.cuda.is_available(), reason="NEEDS A GPU: flash attention on rows of any length")
def test_a_gpus_loss_in_bfloat16_is_near_a_cpus():
    pairs = some_pairs(8)
    model = gpt2(GPT2DoubleHeadsModel)
    exact = float(total(model, [batch_of(pairs)]))
    model.cuda()
    batch = batch_of(pairs, spread=0.0).to(torch.device("cuda"))
    losses = batch_losses(model, batch, torch.bfloat16, compiled=True)
    assert float(weighted(losses, losses.tokens, losses.pairs, 1.0, 2.0)) == pytest.approx(exact, rel=0.02)


def test_the_fused_update_is_the_plain_one():
    torch.manual_seed(0)
    found = []
    for fused in (False, True):
        torch.manual_seed(0)
        weight = torch.nn.Parameter(torch.randn(5, 7, dtype=torch.float64))
        group = {"params": [weight], "lr": 0.01, "weight_decay": 0.1}
        optimizer = MuonAdamW([group], betas=(0.9, 0.98), eps=1e-8, momentum=0.9)
        for _ in range(5):
            weight.grad = torch.randn_like(weight)
            if fused:
                optimizer.make_state([weight])
                optimizer.adamw_fused(optimizer.param_groups[0], [weight])
            else:
                optimizer.step()
        found.append(weight.detach())
    torch.testing.assert_close(*found, rtol=1e-9, atol=1e-12)


def test_negatives_change_the_lm_loss_of_no_model_without_the_second_head():
    pairs = some_pairs(3)
    model = gpt2(GPT2LMHeadModel).double()
    losses = batch_losses(model, batch_of(pairs, choices=False), torch.float64)
    assert losses.pairs == 0
    assert float(losses.mc) == 0.0


def test_lstm_loss_equals_its_own_forward():
    torch.manual_seed(0)
    model = LstmLMHeadModel(LstmConfig(vocab_size=50, embedding_size=8, hidden_size=16)).double()
    prompt, (completion, _) = some_pairs(1)[0]
    ids = torch.tensor(np.concatenate((prompt, completion)))[None]
    labels = ids.clone()
    labels[0, : len(prompt)] = -100
    losses = batch_losses(model, batch_of([(prompt, [completion])], choices=False), torch.float64)
    torch.testing.assert_close(losses.lm / losses.tokens, model(ids, labels=labels).loss)


def test_lstm_goes_on_from_its_state():
    torch.manual_seed(0)
    model = LstmLMHeadModel(LstmConfig(vocab_size=50, embedding_size=8, hidden_size=16)).double()
    ids = torch.randint(0, 50, (2, 9))
    first = model(ids[:, :4])
    rest = model(ids[:, 4:], state=first.state)
    torch.testing.assert_close(torch.cat((first.logits, rest.logits), dim=1), model(ids).logits)
