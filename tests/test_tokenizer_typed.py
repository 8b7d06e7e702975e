"""Slots by type: lossless, a type in every mention, and under the mask the plans of plain canonical words."""

from __future__ import annotations

import random
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from strips_lm import _native  # noqa: E402
from strips_lm.batches import _renumber  # noqa: E402
from strips_lm.config import RunConfig  # noqa: E402
from strips_lm.explain import explain  # noqa: E402
from strips_lm.generate import GUIDED, Planner  # noqa: E402
from strips_lm.guide import Tasks  # noqa: E402
from strips_lm.guides import oracle_guide  # noqa: E402
from strips_lm.tokenizer import CanonicalTokenizer, TokenizerError, TypedTokenizer  # noqa: E402
from test_masked import AS_WRITTEN, KEYS, Questions, questions, untrained, untrained_lstm  # noqa: E402, F401
from test_tokenizer_canonical import (  # noqa: E402  # noqa: E402
    BROKEN,
    COMPLETIONS,
    DOMAIN,
    PROMPTS,
    check_that_it_can_be_saved,
    check_that_transformers_reads_words,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

MANIPULATION = Path(str(files("strips_lm"))) / "domains" / "manipulation" / "domain.pddl"
ODD = [
    "<|startoftext|> <OBJECTS> torch lamp/room, o1 lamp, x room <GOAL> lit(torch) <INIT> at(torch, x), lit(o1)",
    "<|startoftext|> <OBJECTS> torch gizmo, attic room <GOAL> lit(torch) <INIT> at(torch, attic)",
    "<|startoftext|> <OBJECTS> torch <GOAL> lit(torch) <INIT> lit(torch)",
    "<|startoftext|> <OBJECTS> <GOAL> lit(torch) <INIT> at(torch, attic)",
    "<|startoftext|> <OBJECTS> b lamp, a room, b lamp <GOAL> lit(b) <INIT> lit(b)",
    "<GOAL> lit(torch)",
    "",
]
"""Several types, an unknown one, none, no objects, one twice, and what is no prompt."""


@pytest.fixture(scope="module", params=["difference", "progress", "report"])
def tokenizer(request: pytest.FixtureRequest) -> TypedTokenizer:
    codec = _native.CanonicalCodec(_native.Domain.parse(DOMAIN), None, layout=request.param)
    return TypedTokenizer(CanonicalTokenizer(codec, max_slots=8), 3)


def typed() -> TypedTokenizer:
    domain = _native.Domain.parse(MANIPULATION.read_bytes())
    return TypedTokenizer(CanonicalTokenizer(_native.CanonicalCodec(domain), 16), 6)


def test_every_mention_says_the_type(tokenizer: TypedTokenizer) -> None:
    (prompt, bare), (said, _), _ = tokenizer.encode_records(PROMPTS, COMPLETIONS)
    words = " ".join(tokenizer.words[token] for token in [*prompt, *said])
    assert words.startswith("<|startoftext|> <OBJECTS> lamp#0 room#0 room#1 <")
    assert " at lamp#0 room#0" in words
    assert "<ACTION> light lamp#0 <STATE>" in words
    assert not any(word in words.split() for word in ("lamp", "room", "o0", "o1"))
    plain = tokenizer.slotted.encode_prompts(PROMPTS[1:])[0][0]
    assert bare.tolist() == plain.tolist(), "without <OBJECTS> nothing is known of types"


@pytest.mark.parametrize("completions", [COMPLETIONS, BROKEN])
def test_records_come_back_to_the_byte(tokenizer: TypedTokenizer, completions: list[str]) -> None:
    prompts, rest, legends = tokenizer.encode_records(PROMPTS, completions)
    whole = tokenizer.decode([[*p, *c] for p, c in zip(prompts, rest, strict=True)], legends)
    assert whole == [f"{p} {c}" for p, c in zip(PROMPTS, completions, strict=True)]
    assert tokenizer.decode_completions(prompts, [row.tolist() for row in rest], legends) == completions
    alone, _ = tokenizer.encode_prompts(PROMPTS)
    assert [row.tolist() for row in alone] == [row.tolist() for row in prompts]


@pytest.mark.parametrize("prompt", ODD)
def test_odd_prompts_come_back_to_the_byte(tokenizer: TypedTokenizer, prompt: str) -> None:
    for completion in [COMPLETIONS[0], BROKEN[0]]:
        rows, rest, legends = tokenizer.encode_records([prompt], [completion])
        assert tokenizer.decode([[*rows[0], *rest[0]]], legends) == [f"{prompt} {completion}"]


def test_transformers_reads_the_words_and_it_can_be_saved(tokenizer: TypedTokenizer, tmp_path: Path) -> None:
    check_that_transformers_reads_words(tokenizer)
    check_that_it_can_be_saved(tokenizer, tmp_path)


def test_more_objects_of_a_type_than_slots_are_refused_with_a_hint(tokenizer: TypedTokenizer) -> None:
    objects = ", ".join(f"l{i} lamp" for i in range(4))
    with pytest.raises(TokenizerError, match=r"4 objects of type `lamp`.* 3 slots(.|\n)*`tokenizer.type_slots` of 4"):
        tokenizer.encode_prompts([f"<|startoftext|> <OBJECTS> {objects} <GOAL> lit(l0) <INIT> lit(l3)"])


def test_a_slot_that_is_no_object_s_names_none(tokenizer: TypedTokenizer) -> None:
    (prompt, _), legends = tokenizer.encode_prompts(PROMPTS)
    for word in ("lamp#1", "room#2", "o0", "o7"):
        made = [tokenizer.slotted.ids["<ACTION>"], tokenizer.slotted.ids["light"], tokenizer.words.index(word)]
        (text,) = tokenizer.decode_completions([prompt], [made], legends[:1])
        assert text.startswith("<ACTION> light(#"), "a name that no object can have"


def test_slots_are_renumbered_within_their_type() -> None:
    first, rng = ((10, 4), (14, 3), (17, 5)), np.random.default_rng(0)
    parts = [np.array([1, 10, 14, 15, 2]), np.array([15, 3])]
    others = [np.array([20, 1]), np.array([], dtype=np.int64), np.array([17, 17, 30])]
    seen, beside = set(), set()
    for _ in range(300):
        ((one, two), (three, none, four)) = _renumber([parts, others], first, rng)
        assert (three[1], four[2], len(none)) == (1, 30, 0)
        assert 17 <= four[0] == four[1] < three[0] < 22
        beside.add((int(four[0]), int(three[0])))
        assert (one[0], one[4], two[1]) == (1, 2, 3)
        assert 10 <= one[1] < 14 <= one[2] < one[3] < 17
        assert two[0] == one[3]
        seen.add((int(one[1]), int(one[2]), int(one[3])))
    assert {a for a, *_ in seen} == {10, 11, 12, 13}
    assert {(b, c) for _, b, c in seen} == {(14, 15), (14, 16), (15, 16)}
    assert beside == {(17, 20), (17, 21), (18, 21)}


def test_under_the_mask_the_automaton_of_plain_words_is_followed(questions: Questions) -> None:  # noqa: F811
    check_that_the_automaton_of_plain_words_is_followed(typed(), questions)


def check_that_the_automaton_of_plain_words_is_followed(words: TypedTokenizer, questions: Questions) -> None:  # noqa: F811
    plain, rng = words.slotted, random.Random(0)
    ids, legends = words.encode_prompts(questions.prompts)
    guide = oracle_guide(words, legends, questions.oracle())
    twin = oracle_guide(plain, plain.encode_prompts(questions.prompts)[1], questions.oracle())
    for number, prompt in enumerate(ids):
        ((row,), (said,)), ((other,), (spoken,)) = guide.add([number]), twin.add([number])
        for _ in range(40):
            assert words._plain([*prompt, *said], legends[number])[-len(spoken) :] == spoken
            if not guide.is_open([row])[0]:
                back, again = guide.backtrack(row), twin.backtrack(other)
                assert (back is None) == (again is None)
                break
            tokens = np.flatnonzero(guide.mask([row])[0])
            assert sorted(legends[number].words[tokens]) == np.flatnonzero(twin.mask([other])[0]).tolist()
            token = int(rng.choice(tokens))
            said = [*said, token, *guide.advance([row], [token])[0]]
            word = int(legends[number].words[token])
            spoken = [*spoken, word, *twin.advance([other], [word])[0]]


@pytest.mark.parametrize("decode", GUIDED)
def test_guided_texts_that_end_are_valid(questions: Questions, decode: str) -> None:  # noqa: F811
    check_that_guided_texts_that_end_are_valid(typed(), questions, decode)


def check_that_guided_texts_that_end_are_valid(words: TypedTokenizer, questions: Questions, decode: str) -> None:  # noqa: F811
    for model in (untrained(3, 512, words), untrained_lstm(4, words)):
        found = Planner(model, words, RunConfig.load(None, [*KEYS, "generate.max_new=2000"]).generate)
        made = found.complete(questions.prompts, decode, tasks=questions.oracle())
        for completion, judgement in zip(made.completions, questions.judge(made), strict=True):
            assert judgement.executable_steps == judgement.steps == judgement.states_right
            assert completion.finished == judgement.verdict.is_valid
        assert any(completion.finished for completion in made.completions)


def test_an_explanation_calls_objects_by_their_names(questions: Questions) -> None:  # noqa: F811
    words = typed()
    found = Planner(untrained(3, 512, words), words, RunConfig.load(None, [*KEYS, *AS_WRITTEN]).generate)
    made = found.complete(questions.prompts[:3], "masked", tasks=questions.oracle()).completions[1]

    def find(prompts: Sequence[int]) -> tuple[list[_native.Task], list[Sequence[str]]]:
        return questions.oracle().find([1 for _ in prompts])

    steps = explain(found, questions.prompts[1], made, Tasks(questions.domain, find))
    assert all(position.allowed for step in steps for position in step.positions)
    assert all(step.state_written == step.state_true for step in steps)
    assert any("samovar" in step.words or "tea" in step.words for step in steps)
    assert not any("#" in step.words for step in steps)
