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
from strips_lm.decode.decoders import decoders_of  # noqa: E402
from strips_lm.decode.gpt2 import Gpt2Decoder  # noqa: E402
from strips_lm.decode.gpt2_cpu import Gpt2CpuDecoder, fits, pack  # noqa: E402
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


@pytest.fixture(params=["torch", "native"])
def decoder(request: pytest.FixtureRequest, model: Any) -> Any:
    """Makes a decoder of so many rows."""
    if request.param == "torch":
        return lambda rows: Gpt2Decoder(model, rows)
    weights = pack(model)
    return lambda rows: Gpt2CpuDecoder(weights, rows)


def jobs_of(prompts: list[list[int]], draws: int = 1) -> list[Job]:
    return [Job(i, draw, ids) for i, ids in enumerate(prompts) for draw in range(draws)]


def ours(
    decoder: Any, prompts: list[list[int]], rows: int, choose: Any = None, *, workers: int = 1, max_new: int = 30
) -> list:
    def loop() -> Loop:
        return Loop(decoder(rows), choose or Greedy(), Limits(stop=STOP, max_new=max_new), score=True, seed=5)

    return run_jobs(jobs_of(prompts), loop, workers)


def theirs(model: Any, ids: list[int], max_new: int = 30, **options: Any) -> list[int]:
    inputs = torch.tensor([ids])
    options = {"do_sample": False, "max_new_tokens": max_new, "pad_token_id": STOP} | options
    return model.generate(inputs, attention_mask=torch.ones_like(inputs), **options)[0, len(ids) :].tolist()


def test_greedy_equals_transformers(model: Any, decoder: Any, prompts: list[list[int]]) -> None:
    made = ours(decoder, prompts, rows=8)
    assert [g.tokens for g in made] == [theirs(model, ids) for ids in prompts]
    assert len({len(g.tokens) for g in made}) > 3, "the texts should end at different lengths"


@pytest.mark.parametrize(("rows", "workers"), [(1, 1), (3, 1), (64, 1), (5, 2)])
def test_batch_size_and_threads_do_not_change_the_text(decoder: Any, prompts: list, rows: int, workers: int) -> None:
    for choose in (Greedy(), Sample()):
        alone = [g.tokens for g in ours(decoder, prompts, 8, choose)]
        assert [g.tokens for g in ours(decoder, prompts, rows, choose, workers=workers)] == alone


def test_a_pause_ends_a_row_unless_it_is_its_first_token(model: Any, decoder: Any, prompts: list) -> None:
    pause = theirs(model, prompts[0])[0]
    limits = Limits(stop=STOP, max_new=30, pause=pause)
    paused = Loop(decoder(8), Greedy(), limits).run(jobs_of(prompts))
    for ids, made in zip(prompts, paused, strict=True):
        whole = theirs(model, ids)
        cut = next((at for at, token in enumerate(whole) if at and token == pause), len(whole))
        assert made.tokens == whole[:cut]
        assert made.finished == (whole[:cut][-1] == STOP)
    assert any(len(made.tokens) < len(theirs(model, ids)) for ids, made in zip(prompts, paused, strict=True))


def test_no_text_passes_the_context(model: Any, decoder: Any) -> None:
    long = [1, 2, 3] * 20
    (made,) = ours(decoder, [long], rows=2, max_new=500)
    assert len(long) + len(made.tokens) <= model.config.n_positions + 1
    assert made.finished == (made.tokens[-1] == STOP)


def test_chunks_equal_single_tokens(decoder: Any) -> None:
    ids = torch.tensor([[5, 6, 7, 8], [9, 10, 11, 0]])
    whole, stepped = decoder(2), decoder(2)
    at_once = whole.feed(0, ids, torch.tensor([4, 3]))
    stepped.feed(0, ids[:, :1], torch.tensor([1, 1]))
    by_parts = stepped.feed(0, ids[:, 1:], torch.tensor([3, 2]))
    torch.testing.assert_close(at_once, by_parts)


@pytest.mark.parametrize("activation", ["gelu_new", "relu", "relu2"])
@pytest.mark.parametrize(("width", "heads", "vocabulary"), [(32, 4, 12), (48, 3, 77), (33, 11, 50), (20, 4, 513)])
def test_the_native_decoder_is_the_other_whatever_was_fed_moved_and_forgotten(
    activation: str, width: int, heads: int, vocabulary: int
) -> None:
    torch.manual_seed(width)
    model = GPT2LMHeadModel(
        GPT2Config(
            vocab_size=vocabulary,
            n_positions=64,
            n_embd=width,
            n_layer=3,
            n_head=heads,
            activation_function=activation,
            scale_attn_by_inverse_layer_idx=heads == 3,
            bos_token_id=STOP,
            eos_token_id=STOP,
        )
    ).eval()
    for parameter in model.parameters():
        torch.nn.init.normal_(parameter, std=0.2)
    assert fits(model)
    assert isinstance(decoders_of(model)(1), Gpt2CpuDecoder)
    native, other = decoders_of(model)(9), Gpt2Decoder(model, 9)
    draw = random.Random(width)
    with torch.inference_mode():
        for _ in range(25):
            rows = draw.randint(1, 9)
            first, longest = draw.randint(0, 9 - rows), draw.randint(1, 6)
            ids = torch.tensor([[draw.randrange(vocabulary) for _ in range(longest)] for _ in range(rows)])
            counts = torch.tensor([draw.randint(1, longest) for _ in range(rows)])
            found, wanted = (each.feed(first, ids, counts) for each in (native, other))
            torch.testing.assert_close(found, wanted, rtol=0, atol=2e-6 * float(wanted.abs().max()))
            sources, targets = (torch.tensor(draw.sample(range(9), 3)) for _ in range(2))
            row, fresh = draw.randrange(9), draw.randrange(9)
            for each in (native, other):
                each.move(sources, targets)
                each.rewind(row, int(each.lengths[row]) // 2)
                each.clear(fresh, 1)
            assert native.lengths.tolist() == other.lengths.tolist()


def test_a_row_s_logits_are_its_own_to_the_last_bit(model: Any) -> None:
    weights, draw = pack(model), random.Random(0)
    texts = [[draw.randrange(VOCABULARY) for _ in range(30)] for _ in range(40)]
    together = Gpt2CpuDecoder(weights, 40).feed(0, torch.tensor(texts), torch.full((40,), 30))
    for i in (0, 17, 39):
        alone = Gpt2CpuDecoder(weights, 1)
        for token in texts[i]:
            found = alone.feed(0, torch.tensor([[token]]), torch.tensor([1]))
        assert torch.equal(found[0], together[i])


def test_the_native_decoder_refuses_what_it_cannot_read(model: Any) -> None:
    decoder, one = Gpt2CpuDecoder(pack(model), 2), torch.tensor([1])
    for first, ids, counts in (
        (0, [[VOCABULARY]], [1]),
        (0, [[-1]], [1]),
        (2, [[1]], [1]),
        (0, [[1]], [2]),
        (0, [[1]], [0]),
        (0, [[1], [1]], [1]),
    ):
        with pytest.raises(ValueError, match=r"vocabulary|rows|counts"):
            decoder.feed(first, torch.tensor(ids), torch.tensor(counts))
    with pytest.raises(ValueError, match="rows"):
        decoder.move(one + 1, one)
    with pytest.raises(ValueError, match="rows"):
        decoder.rewind(2, 0)
    assert not fits(model.double())
    model.float()
    broken = GPT2LMHeadModel(model.config)
    broken.transformer.ln_f.weight = torch.nn.Parameter(torch.ones(31))
    with pytest.raises(ValueError, match="shapes"):
        pack(broken)


def test_log_probability_is_the_models(model: Any, decoder: Any, prompts: list[list[int]]) -> None:
    for made in ours(decoder, prompts[:5], rows=2, choose=Sample()):
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


def test_beam_of_one_is_greedy(decoder: Any, prompts: list[list[int]]) -> None:
    limits = Limits(stop=STOP, max_new=20)
    beams = beam_search(jobs_of(prompts), decoder, limits, width=1, rows=4)
    assert [g.tokens for g in beams] == [g.tokens for g in ours(decoder, prompts, 8, max_new=20)]


def test_wider_beams_are_no_less_likely(decoder: Any, prompts: list[list[int]]) -> None:
    def scores(width: int) -> list[float]:
        limits = Limits(stop=STOP, max_new=12)
        made = beam_search(jobs_of(prompts), decoder, limits, width=width, penalty=0.0)
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
