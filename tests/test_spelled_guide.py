"""The mask over pieces of names: it lets through the texts of the mask over slots, spelled, and no others."""

from __future__ import annotations

import random
from typing import TYPE_CHECKING, Any

import pytest

pytest.importorskip("torch")
from strips_lm import _native
from strips_lm.config import RunConfig
from strips_lm.generate import Planner
from strips_lm.guides import oracle_guide
from strips_lm.spelled_guide import SpelledGuide
from strips_lm.tokenizer import CanonicalTokenizer, SpelledTokenizer
from strips_lm.tokenizer.spelled import learn_pieces
from test_masked import KEYS, MANIPULATION, Questions, untrained

if TYPE_CHECKING:
    from collections.abc import Iterator

PROBLEM = """(define (problem alike) (:domain manipulation)
  (:objects te - fixture tea - movable teap - movable teapot - vessel tear - movable)
  (:init (inworkspace table) (inworkspace te) (inworkspace tea) (inworkspace teapot) (on teapot table) (on tea te)
    (inworkspace teap) (on teap te) (inworkspace tear) (on tear teap))
  (:goal (and (on tear table) (on teap teapot))))"""
"""Names that begin with each other, split so that one name's pieces are the beginning of another's."""


@pytest.fixture(scope="module")
def questions() -> Questions:
    return Questions(MANIPULATION / "domain.pddl", [PROBLEM])


@pytest.fixture(
    scope="module",
    params=[
        (["te"], True, "difference"),
        (["te", "tea"], False, "progress"),
        (["tea", "teapot"], True, "progress"),
        ([], False, "difference"),
        (["te"], True, "report"),
    ],
)
def tokenizer(request: Any) -> SpelledTokenizer:
    names, kinds, layout = request.param
    domain = _native.Domain.parse((MANIPULATION / "domain.pddl").read_bytes())
    words = CanonicalTokenizer(_native.CanonicalCodec.of_domains([(domain, None)], layout=layout, kinds=kinds), 64)
    return SpelledTokenizer(words, learn_pieces([*names * 50, "table"], 256 + 4 * len(names)))


def prompted(tokenizer: SpelledTokenizer, questions: Questions) -> tuple[SpelledGuide, list[int], list[Any]]:
    _, legends = tokenizer.encode_prompts(questions.prompts)
    guide = oracle_guide(tokenizer, legends, questions.oracle())
    assert isinstance(guide, SpelledGuide)
    (row,), (forced,) = guide.add([0])
    return guide, [row, *forced], legends


def walks(guide: SpelledGuide, row: int, forced: list[int], seed: int) -> Iterator[list[int]]:
    """Random texts that the mask lets through, until one ends or is stuck."""
    rng = random.Random(seed)
    tokens = list(forced)
    while guide.is_open([row])[0] and len(tokens) < 600:
        allowed = guide.mask([row])[0].nonzero()[0].tolist()
        token = rng.choice(allowed)
        tokens += [token, *guide.advance([row], [token])[0]]
        yield tokens


def test_random_walks_spell_what_the_canonical_mask_lets_through(
    tokenizer: SpelledTokenizer, questions: Questions
) -> None:
    prompts, _ = tokenizer.encode_prompts(questions.prompts)
    for seed in range(40):
        guide, (row, *forced), legends = prompted(tokenizer, questions)
        tokens = forced
        for said in walks(guide, row, forced, seed):
            tokens = said
        text = tokenizer.decode_completions(prompts, [tokens], legends)
        asked, words, _ = tokenizer.slotted.encode_records(questions.prompts, text)
        assert [*tokenizer.encode_records(questions.prompts, text)[1][0]] == tokens or len(tokens) >= 600
        twin = oracle_guide(tokenizer.slotted, legends, questions.oracle())
        (there,), (said,) = twin.add([0])
        rest = words[0].tolist()
        assert rest[: len(said)] == said
        rest = rest[len(said) :]
        while rest and len(tokens) < 600:
            assert twin.mask([there])[0][rest[0]], text
            after = [rest[0], *twin.advance([there], [rest[0]])[0]]
            assert rest[: len(after)] == after
            rest = rest[len(after) :]
        assert len(asked) == 1


def test_every_plan_can_be_spelled_at_every_step(tokenizer: SpelledTokenizer, questions: Questions) -> None:
    plans = questions.tasks[0].plan_set(7, "simple")
    assert plans.count() > 10
    for number in range(0, int(plans.count()), max(1, int(plans.count()) // 25)):
        guide, (row, *_), _ = prompted(tokenizer, questions)
        for step, operator in enumerate(plans[number], 1):
            if guide.steps(row) >= step:
                continue
            found = guide.write(row, operator)
            assert found is not None, (operator, plans[number])
            row = found[0]
        assert guide.has_ended(row) or guide.mask([row])[0][tokenizer.end_id]


def test_a_fork_goes_on_by_itself(tokenizer: SpelledTokenizer, questions: Questions) -> None:
    guide, (row, *forced), _ = prompted(tokenizer, questions)
    for _ in walks(guide, row, forced, 3):
        other = guide.fork(row)
        before = guide.mask([row])[0].copy()
        for _ in walks(guide, other, [], 4):
            pass
        guide.remove([other])
        assert (guide.mask([row])[0] == before).all()


def test_a_token_that_may_not_come_is_refused(tokenizer: SpelledTokenizer, questions: Questions) -> None:
    guide, (row, *forced), _ = prompted(tokenizer, questions)
    for _ in walks(guide, row, forced, 5):
        allowed = guide.mask([row])[0] if guide.is_open([row])[0] else None
        for token in range(0, tokenizer.vocab_size, 7) if allowed is not None else ():
            there = guide.fork(row)
            if allowed[token]:
                guide.advance([there], [token])
            else:
                with pytest.raises(ValueError, match="may not"):
                    guide.advance([there], [token])
            guide.remove([there])


@pytest.mark.parametrize("decode", ["masked", "masked-replan", "search", "search-replan"])
def test_what_an_untrained_model_ends_is_valid(tokenizer: SpelledTokenizer, questions: Questions, decode: str) -> None:
    settings = RunConfig.load(None, [*KEYS, "generate.max_new=900", "generate.search_calls=60"]).generate
    found = Planner(untrained(2, 1400, tokenizer), tokenizer, settings)
    made = found.complete(questions.prompts, decode, tasks=questions.oracle())
    (judged,) = questions.judge(made)
    assert judged.verdict.is_valid == made.completions[0].finished


def test_a_shortened_plan_is_spelled_like_any_other(tokenizer: SpelledTokenizer, questions: Questions) -> None:
    shorter = 0
    for seed in range(6):
        model, plans = untrained(seed, 1400, tokenizer), []
        for shorten in ("false", "true"):
            settings = RunConfig.load(None, [*KEYS, "generate.max_new=4000", f"generate.shorten={shorten}"]).generate
            made = Planner(model, tokenizer, settings).complete(questions.prompts, "masked", tasks=questions.oracle())
            (judged,) = questions.judge(made)
            assert judged.verdict.is_valid == made.completions[0].finished
            assert judged.states_right == judged.states_total == judged.steps
            plans.append(judged.steps)
        shorter += plans[1] < plans[0]
        assert plans[1] <= plans[0]
    assert shorter
