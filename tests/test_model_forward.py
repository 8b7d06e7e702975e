"""The training forward pass is transformers' own, in float64, and its bfloat16 is near it."""

import pytest
import torch
from transformers import GPT2Config, GPT2DoubleHeadsModel, GPT2LMHeadModel

from strips_lm import forward, tuning
from strips_lm.config import TrainConfig
from strips_lm.forward import hidden_at


def gpt2(kind=GPT2LMHeadModel, **changes):
    torch.manual_seed(0)
    sizes = {"vocab_size": 50, "n_positions": 64, "n_embd": 32, "n_layer": 2, "n_head": 4}
    quiet = {"resid_pdrop": 0.0, "embd_pdrop": 0.0, "attn_pdrop": 0.0, "summary_first_dropout": 0.0}
    kept = {"bos_token_id": 0, "eos_token_id": 0, "initializer_range": 0.3}
    return kind(GPT2Config(**{**sizes, **quiet, **kept, **changes}))


def tokens(rows=3, length=20):
    torch.manual_seed(1)
    return torch.randint(0, 50, (rows, length)), torch.arange(length)[None, :] + torch.tensor([[0], [7], [40]])[:rows]


@pytest.mark.parametrize("activation", ["gelu_new", "relu", "relu2"])
def test_hidden_states_equal_those_of_transformers(activation):
    model = gpt2(activation_function=activation).double()
    ids, positions = tokens()
    at = torch.tensor([3, 25, 59, 3])
    theirs = model.transformer(ids, position_ids=positions).last_hidden_state.reshape(60, -1)[at]
    ours = hidden_at(model.transformer, ids, positions, at, torch.float64)
    torch.testing.assert_close(ours, theirs, rtol=0, atol=1e-11)


def test_gradients_equal_those_of_transformers():
    grads = []
    for own in (True, False):
        model = gpt2().double()
        ids, positions = tokens()
        at = torch.tensor([3, 25, 59])
        if own:
            hidden = hidden_at(model.transformer, ids, positions, at, torch.float64)
        else:
            hidden = model.transformer(ids, position_ids=positions).last_hidden_state.reshape(60, -1)[at]
        hidden.square().sum().backward()
        grads.append({name: parameter.grad for name, parameter in model.named_parameters()})
    for name, grad in grads[0].items():
        torch.testing.assert_close(grad, grads[1][name], rtol=1e-9, atol=1e-9, msg=name)


def test_padding_on_the_right_changes_nothing():
    model = gpt2().double()
    ids, positions = tokens(1, 20)
    at = torch.arange(12)
    short = hidden_at(model.transformer, ids[:, :12], positions[:, :12], at, torch.float64)
    torch.testing.assert_close(hidden_at(model.transformer, ids, positions, at, torch.float64), short)


def test_bfloat16_is_near_float32():
    model = gpt2(GPT2DoubleHeadsModel)
    ids, positions = tokens()
    at = torch.arange(60)
    exact = hidden_at(model.transformer, ids, positions, at, torch.float32)
    rounded = hidden_at(model.transformer, ids, positions, at, torch.bfloat16).float()
    assert (exact - rounded).norm() / exact.norm() < 0.03


def test_dropout_acts_in_training_only():
    model = gpt2()
    model.transformer.h[0].mlp.dropout.p = 0.5
    ids, positions = tokens()
    runs = [hidden_at(model.transformer, ids, positions, torch.arange(9), torch.float32) for _ in range(2)]
    assert not torch.equal(*runs)
    model.eval()
    runs = [hidden_at(model.transformer, ids, positions, torch.arange(9), torch.float32) for _ in range(2)]
    assert torch.equal(*runs)


@pytest.mark.parametrize(("quicker", "wanted"), [(True, "bfloat16"), (False, "float32")])
def test_layers_run_in_bfloat16_only_where_the_processor_multiplies_it_quicker(quicker, wanted, monkeypatch):
    monkeypatch.setattr(tuning, "multiplies_bfloat16", lambda _device: quicker)
    chosen = [tuning.default(TrainConfig(precision=name), gpt2(), torch.device("cpu")) for name in ("auto", "bfloat16")]
    assert [choice.precision for choice in chosen] == [wanted, "bfloat16"]


@pytest.mark.filterwarnings("ignore:The .grad attribute")  # dynamo looks at it on every tensor
def test_compiled_layers_give_the_same_numbers_for_blocks_of_any_shape(monkeypatch):
    """Traced and differentiated as `torch.compile` does, without the C++ compiler that would come last."""
    compile_ = torch.compile
    monkeypatch.setattr(torch, "compile", lambda side, dynamic: compile_(side, dynamic=dynamic, backend="aot_eager"))
    forward.compiled_sides.cache_clear()
    torch._dynamo.reset()
    model = gpt2()
    for rows, length in ((3, 20), (1, 7), (5, 31)):
        ids = torch.randint(0, 40, (rows, length))
        at = torch.arange(rows * length)
        found = []
        for compiled in (False, True):
            model.zero_grad()
            places = torch.arange(length).expand_as(ids)
            hidden = hidden_at(model.transformer, ids, places, at, torch.float32, compiled=compiled)
            hidden.square().sum().backward()
            found.append([hidden, *(weight.grad for weight in model.transformer.parameters())])
        for plain, traced in zip(*found, strict=True):
            torch.testing.assert_close(plain, traced)
    assert torch._dynamo.utils.counters["stats"]["unique_graphs"] <= 4, "one for each side, and for one row at most"
    forward.compiled_sides.cache_clear()


def test_attention_in_bfloat16_gives_bfloat16_back():
    model = gpt2()
    ids, positions = tokens()
    hidden = hidden_at(model.transformer, ids, positions, torch.arange(60), torch.bfloat16)
    assert hidden.dtype == torch.bfloat16
