"""The probability of a step is the product of its tokens'."""

from __future__ import annotations

import math

import pytest

torch = pytest.importorskip("torch")
torch.set_num_threads(1)

from strips_lm.stepwise import stepwise  # noqa: E402
from test_generate import PROMPTS, TEXT, checkpoint, planner  # noqa: E402, F401  (a fixture is used by its name)


def test_steps_multiply_to_the_whole_text(checkpoint) -> None:  # noqa: F811
    found = planner(checkpoint)
    texts = [TEXT, TEXT.replace("<STATE> inhand(cup) ", "")]
    for prompt, text, probable in zip(PROMPTS, texts, stepwise(found, PROMPTS, texts), strict=True):
        asked, said, _ = found.tokenizer.encode_records([prompt], [text])
        ids = torch.tensor([[*map(int, asked[0]), *map(int, said[0])]])
        with torch.no_grad():
            every = found.model.transformer(ids).last_hidden_state
            log_probs = found.model.lm_head(every).log_softmax(-1)[0]
        start = len(asked[0]) - 1
        whole = sum(float(log_probs[start + n, token]) for n, token in enumerate(said[0].tolist()))
        assert probable.end is not None
        parts = [*probable.operators, *probable.states, probable.end]
        assert sum(map(math.log, parts)) == pytest.approx(whole, rel=1e-3)
        assert len(probable.operators) == len(probable.states) == 2
    assert stepwise(found, PROMPTS[:1], texts[1:])[0].states[0] == 1.0, "no state, no doubt"


def test_a_text_without_an_end_has_no_probability_of_it(checkpoint) -> None:  # noqa: F811
    found = stepwise(planner(checkpoint), PROMPTS[:1], ["<ACTION> pick(cup) <STATE> inhand(cup)"])[0]
    assert found.end is None
    odd = stepwise(planner(checkpoint), PROMPTS[:1], ["<STATE> inhand(cup) <|endoftext|>"])[0]
    assert (odd.operators, odd.states) == ([], []), "a state before any action belongs to no step"
    assert stepwise(planner(checkpoint), [], []) == []
