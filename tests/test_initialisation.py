"""What a GPT-2 starts from beside random weights."""

from __future__ import annotations

import pytest
import torch

from strips_lm.config import ConfigError, ModelConfig
from strips_lm.initialisation import sinusoids
from strips_lm.model import make_model

LENGTH = 200


class Words:
    """As much of a tokenizer as a model is made from."""

    vocab_size, start_id, end_id = 90, 1, 0


def attention(config: ModelConfig, first: int) -> torch.Tensor:
    """(heads, LENGTH, LENGTH) of the first block, for random tokens that start at position `first`."""
    model = make_model(config, Words(), seed=3).eval()  # type: ignore[arg-type]
    model.set_attn_implementation("eager")
    ids = torch.randint(90, (1, LENGTH), generator=torch.Generator().manual_seed(5))
    places = torch.arange(first, first + LENGTH)[None]
    found = model.transformer(input_ids=ids, position_ids=places, output_attentions=True)
    return found.attentions[0][0].detach()


@pytest.mark.parametrize("kind", ["double-head", "lm-head"])
@pytest.mark.parametrize(("width", "heads"), [(128, 4), (384, 6), (768, 12)])
def test_the_first_heads_look_back_wherever_they_are(kind, width, heads):
    config = ModelConfig(kind=kind, layers=1, width=width, heads=heads, context=512, previous_token_heads=3)
    for first in (0, 300):
        seen = attention(config, first)
        for head in range(3):
            back = torch.diagonal(seen[head], -(head + 1))
            assert back[5:].mean() > 0.9
            looked_at = torch.arange(LENGTH) - seen[head].argmax(-1)
            assert (looked_at[5:] == head + 1).float().mean() > 0.97
        assert torch.diagonal(seen[3], -1)[5:].mean() < 0.1, "the others are as random as they were"


def test_no_head_looks_back_unless_asked():
    seen = attention(ModelConfig(layers=1, context=512), 0)
    assert max(torch.diagonal(seen[head], -1)[5:].mean() for head in range(4)) < 0.2


def test_what_cannot_be_is_said():
    with pytest.raises(ConfigError, match=r"`model[.]previous_token_heads` are 0 to `model[.]heads`, 4"):
        ModelConfig(heads=4, previous_token_heads=5)
    with pytest.raises(ConfigError, match=r"model[.]previous_token_heads=0"):
        ModelConfig(positions="normal", previous_token_heads=1)


def test_sinusoids_are_those_of_the_paper():
    table = sinusoids(10, 6)
    assert table.shape == (10, 6)
    torch.testing.assert_close(table[0], torch.tensor([0.0, 1.0] * 3))
    torch.testing.assert_close(table[:, 0], torch.arange(10.0).sin())
