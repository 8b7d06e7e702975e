"""The decoders give what transformers gives, whatever the batch."""

from __future__ import annotations

import random
from typing import Any

import pytest

torch = pytest.importorskip("torch")
torch.set_num_threads(1)

from transformers import GPT2Config, GPT2LMHeadModel  # noqa: E402

from strips_lm.decode import Greedy, Job, Limits, Loop, Sample, run_jobs  # noqa: E402
from strips_lm.decode.beam import beam_search  # noqa: E402
from strips_lm.decode.choose import uniforms  # noqa: E402
from strips_lm.decode.gpt2 import Gpt2Decoder  # noqa: E402
from strips_lm.decode.lstm import LstmDecoder  # noqa: E402

STOP = 0
VOCABULARY = 12


@pytest.fixture(scope="module")
def model() -> Any:
    torch.manual_seed(1)
    config = GPT2Config(
        vocab_size=VOCABULARY, n_positions=64, n_embd=32, n_layer=2, n_head=4, bos_token_id=STOP, eos_token_id=STOP
    )
    model = GPT2LMHeadModel(config).eval()
    with torch.no_grad():  # spread the logits, so that no two tokens tie and texts end at different lengths
        for parameter in model.parameters():
            parameter.mul_(6)
        model.transformer.ln_f.weight.fill_(1.0)
        model.transformer.wpe.weight.mul_(4)
    return model


@pytest.fixture(scope="module")
def prompts() -> list[list[int]]:
    draw = random.Random(3)
    return [[draw.randrange(1, VOCABULARY) for _ in range(draw.randrange(3, 20))] for _ in range(37)]


def jobs_of(prompts: list[list[int]], draws: int = 1) -> list[Job]:
    return [Job(i, draw, ids) for i, ids in enumerate(prompts) for draw in range(draws)]


def ours(
    model: Any, prompts: list[list[int]], rows: int, choose: Any = None, *, workers: int = 1, max_new: int = 30
) -> list:
    def loop() -> Loop:
        return Loop(
            Gpt2Decoder(model, rows), choose or Greedy(), Limits(stop=STOP, max_new=max_new), score=True, seed=5
        )

    return run_jobs(jobs_of(prompts), loop, workers)


def theirs(model: Any, ids: list[int], max_new: int = 30, **options: Any) -> list[int]:
    inputs = torch.tensor([ids])
    options = {"do_sample": False, "max_new_tokens": max_new, "pad_token_id": STOP} | options
    return model.generate(inputs, attention_mask=torch.ones_like(inputs), **options)[0, len(ids) :].tolist()


def test_greedy_equals_transformers(model: Any, prompts: list[list[int]]) -> None:
    made = ours(model, prompts, rows=8)
    assert [g.tokens for g in made] == [theirs(model, ids) for ids in prompts]
    assert len({len(g.tokens) for g in made}) > 3, "the texts should end at different lengths"


@pytest.mark.parametrize(("rows", "workers"), [(1, 1), (3, 1), (64, 1), (5, 2)])
def test_batch_size_and_threads_do_not_change_the_text(model: Any, prompts: list, rows: int, workers: int) -> None:
    for choose in (Greedy(), Sample()):
        alone = [g.tokens for g in ours(model, prompts, 8, choose)]
        assert [g.tokens for g in ours(model, prompts, rows, choose, workers=workers)] == alone


def test_a_pause_ends_a_row_unless_it_is_its_first_token(model: Any, prompts: list[list[int]]) -> None:
    pause = theirs(model, prompts[0])[0]
    limits = Limits(stop=STOP, max_new=30, pause=pause)
    paused = Loop(Gpt2Decoder(model, 8), Greedy(), limits).run(jobs_of(prompts))
    for ids, made in zip(prompts, paused, strict=True):
        whole = theirs(model, ids)
        cut = next((at for at, token in enumerate(whole) if at and token == pause), len(whole))
        assert made.tokens == whole[:cut]
        assert made.finished == (whole[:cut][-1] == STOP)
    assert any(len(made.tokens) < len(theirs(model, ids)) for ids, made in zip(prompts, paused, strict=True))


def test_no_text_passes_the_context(model: Any) -> None:
    long = [1, 2, 3] * 20
    (made,) = ours(model, [long], rows=2, max_new=500)
    assert len(long) + len(made.tokens) <= model.config.n_positions + 1
    assert made.finished == (made.tokens[-1] == STOP)


def test_chunks_equal_single_tokens(model: Any) -> None:
    ids = torch.tensor([[5, 6, 7, 8], [9, 10, 11, 0]])
    whole, stepped = Gpt2Decoder(model, 2), Gpt2Decoder(model, 2)
    at_once = whole.feed(0, ids, torch.tensor([4, 3]))
    stepped.feed(0, ids[:, :1], torch.tensor([1, 1]))
    by_parts = stepped.feed(0, ids[:, 1:], torch.tensor([3, 2]))
    torch.testing.assert_close(at_once, by_parts)


def test_log_probability_is_the_models(model: Any, prompts: list[list[int]]) -> None:
    for made in ours(model, prompts[:5], rows=2, choose=Sample()):
        ids = torch.tensor([[*prompts[made.prompt], *made.tokens]])
        with torch.no_grad():
            log_probs = model(ids).logits.log_softmax(-1)[0, len(prompts[made.prompt]) - 1 : -1]
        expected = log_probs.gather(-1, torch.tensor(made.tokens)[:, None]).sum()
        assert made.log_probability == pytest.approx(float(expected), abs=1e-3)


def test_sampling_follows_the_truncated_distribution() -> None:
    logits = torch.tensor([0.5, 0.25, 0.15, 0.06, 0.04]).log().expand(20_000, -1)
    tokens = Sample(top_k=4, top_p=0.9)(logits, uniforms(0, 0, 0, 20_000))
    shares = torch.bincount(tokens, minlength=5) / 20_000
    # top-k leaves 0.96 of the mass; of that, three tokens hold 0.9375 >= 0.9
    expected = torch.tensor([0.5, 0.25, 0.15, 0.0, 0.0]) / 0.9
    torch.testing.assert_close(shares, expected, atol=0.015, rtol=0)


def test_beam_of_one_is_greedy(model: Any, prompts: list[list[int]]) -> None:
    limits = Limits(stop=STOP, max_new=20)
    beams = beam_search(jobs_of(prompts), lambda rows: Gpt2Decoder(model, rows), limits, width=1, rows=4)
    assert [g.tokens for g in beams] == [g.tokens for g in ours(model, prompts, 8, max_new=20)]


def test_wider_beams_are_no_less_likely(model: Any, prompts: list[list[int]]) -> None:
    def scores(width: int) -> list[float]:
        limits = Limits(stop=STOP, max_new=12)
        made = beam_search(jobs_of(prompts), lambda rows: Gpt2Decoder(model, rows), limits, width=width, penalty=0.0)
        return [g.log_probability for g in made]

    narrow, wide = scores(1), scores(8)
    assert sum(wide) > sum(narrow)


def test_lstm_rows_equal_the_model_alone(prompts: list[list[int]]) -> None:
    from strips_lm.lstm import LstmConfig, LstmLMHeadModel

    torch.manual_seed(2)
    model = LstmLMHeadModel(LstmConfig(vocab_size=VOCABULARY, embedding_size=16, hidden_size=24)).eval()
    limits = Limits(stop=STOP, max_new=15)
    made = run_jobs(jobs_of(prompts), lambda: Loop(LstmDecoder(model, 6), Greedy(), limits))
    for generation in made:
        ids = torch.tensor([[*prompts[generation.prompt], *generation.tokens]])
        with torch.no_grad():
            logits = model(ids).logits[0]
        start = len(prompts[generation.prompt]) - 1
        assert logits[start:-1].argmax(-1).tolist() == generation.tokens
