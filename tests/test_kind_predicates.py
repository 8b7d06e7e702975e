"""Slots by kind in domains without types: predicates that nothing changes say what an object is."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

torch = pytest.importorskip("torch")

from strips_lm import _native  # noqa: E402
from strips_lm.generate import GUIDED  # noqa: E402
from strips_lm.tokenizer import CanonicalTokenizer, TokenizerError, TypedTokenizer  # noqa: E402
from strips_lm.tokenizer.base import read_settings, write_settings  # noqa: E402
from test_masked import Questions  # noqa: E402
from test_tokenizer_canonical import DOMAIN as TYPED_DOMAIN  # noqa: E402
from test_tokenizer_canonical import PROMPTS as TYPED_PROMPTS  # noqa: E402
from test_tokenizer_typed import (  # noqa: E402
    check_that_guided_texts_that_end_are_valid,
    check_that_the_automaton_of_plain_words_is_followed,
)

if TYPE_CHECKING:
    from pathlib import Path

DOMAIN = """(define (domain porter)
  (:predicates (thing ?x) (room ?x) (crate ?x) (lamp ?x) (sealed ?x) (at ?x ?r) (lit ?x) (beside ?a ?b))
  (:action carry :parameters (?x ?a ?b) :precondition (and (thing ?x) (room ?a) (room ?b) (at ?x ?a))
    :effect (and (not (at ?x ?a)) (at ?x ?b)))
  (:action light :parameters (?x) :precondition (and (lamp ?x) (not (lit ?x))) :effect (lit ?x))
  (:action seal :parameters (?x) :precondition (crate ?x) :effect (sealed ?x)))"""
PROBLEM = """(define (problem p-{number}) (:domain porter) (:objects hall box attic torch ghost {extra})
  (:init (thing box) (thing torch) (room hall) (room attic) (crate box) (lamp torch) (at box hall) (at torch attic)
    {more}) (:goal {goal}))"""
EXTRAS = [("", ""), ("chest", "(thing chest) (crate chest) (at chest attic)"), ("den", "(room den) (beside den hall)")]
GOALS = ["(lit torch)", "(at box attic)", "(and (at torch hall) (sealed box))", "(and (not (at box hall)) (lit torch))"]
PROMPT = (
    "<|startoftext|> <OBJECTS> hall object, box object, attic object, torch object, ghost object <GOAL> {goal} "
    "<INIT> thing(box), thing(torch), room(hall), room(attic), crate(box), lamp(torch), at(box, hall), at(torch, attic)"
)
ODD = [
    PROMPT.format(goal="lit(torch)").replace("lamp(torch), ", ""),
    PROMPT.format(goal="lit(torch)").replace("lamp(torch)", "lamp(nobody)"),
    PROMPT.format(goal="lit(torch)").replace("lamp(torch)", "lamp(torch, box)"),
    PROMPT.format(goal="lit(torch)").replace("lamp(torch)", "lamp("),
    PROMPT.format(goal="lit(torch)").replace("box object", "box gizmo"),
    PROMPT.format(goal="lit(torch)").replace("box object", "box"),
    PROMPT.format(goal="lit(torch)").replace("ghost object", "box object"),
    PROMPT.format(goal="lit(torch)").partition(" <INIT>")[0],
    "<|startoftext|> <OBJECTS> a object <INIT> room(a)",
    "<|startoftext|> <GOAL> lit(torch) <INIT> lamp(torch), room(hall)",
]
"""A kind that nothing says, of nobody, of two, broken off; other types, none; one object twice; no start; no list."""
COMPLETIONS = [
    "<ACTION> light(torch) <STATE> thing(box), lit(torch) <|endoftext|>",
    "<ACTION> carry(box, hall, attic) <STATE> at(box, attic",
    "<ACTION> fly(ghost) <STATE> lit(nobody) <|endoftext|>",
]


def of(domain: str, layout: str = "progress", **options: bool) -> TypedTokenizer:
    codec = _native.CanonicalCodec(_native.Domain.parse(domain), None, layout=layout)  # type: ignore[arg-type]
    return TypedTokenizer(CanonicalTokenizer(codec, 16), 6, **options)


@pytest.fixture(scope="module", params=["difference", "progress", "report"])
def tokenizer(request: pytest.FixtureRequest) -> TypedTokenizer:
    return of(DOMAIN, request.param)


@pytest.fixture(scope="module")
def questions(tmp_path_factory: pytest.TempPathFactory) -> Questions:
    path = tmp_path_factory.mktemp("porter") / "domain.pddl"
    path.write_text(DOMAIN)
    asked = [(extra, more, goal) for extra, more in EXTRAS for goal in GOALS]
    texts = [PROBLEM.format(number=n, extra=e, more=m, goal=g) for n, (e, m, g) in enumerate(asked)]
    return Questions(path, texts)


def said(tokenizer: TypedTokenizer, prompt: str) -> list[str]:
    (row,), _ = tokenizer.encode_prompts([prompt])
    words = [tokenizer.words[token] for token in row]
    return words[2 : next(at for at in range(2, len(words)) if words[at].startswith("<"))]


def test_a_slot_says_the_rarest_predicate_that_nothing_changes(tokenizer: TypedTokenizer) -> None:
    prompt = PROMPT.format(goal="lit(torch)")
    assert said(tokenizer, prompt) == ["room#0", "crate#0", "room#1", "lamp#0", "object#0"], "and none of a ghost"
    rows, rest, _ = tokenizer.encode_records([prompt], COMPLETIONS[:1])
    words = " ".join(tokenizer.words[token] for token in [*rows[0], *rest[0]])
    assert "at crate#0 room#0" in words
    assert "<ACTION> light lamp#0 <STATE>" in words
    told = tokenizer.slotted.codec.layout == "report"
    assert (" room room#0" in words, " crate crate#0" in words) == (told, told), "the slot says it"
    assert " thing crate#0 thing lamp#0" in words, "what it does not say stands there"
    assert "sealed#0" not in tokenizer.words, "what an action changes says nothing of what an object is"
    assert "beside#0" not in tokenizer.words, "nor what two objects have to do with each other"


def test_of_two_as_rare_the_later_one_is_said(tokenizer: TypedTokenizer) -> None:
    prompt = PROMPT.format(goal="lit(torch)").replace("crate(box)", "crate(box), crate(torch)")
    assert said(tokenizer, prompt)[1] == "crate#0"
    assert said(tokenizer, prompt)[3] == "lamp#0"


@pytest.mark.parametrize("prompt", [PROMPT.format(goal="at(box, attic), lit(torch)"), *ODD])
def test_texts_come_back_to_the_byte(tokenizer: TypedTokenizer, prompt: str) -> None:
    for completion in COMPLETIONS:
        rows, rest, legends = tokenizer.encode_records([prompt], [completion])
        assert tokenizer.decode([[*rows[0], *rest[0]]], legends) == [f"{prompt} {completion}"]
        assert tokenizer.decode_completions(rows, [rest[0].tolist()], legends) == [completion]
        assert tokenizer.encode_prompts([prompt])[0][0].tolist() == rows[0].tolist()


def test_what_is_said_of_an_object_that_is_not_listed_stays(tokenizer: TypedTokenizer) -> None:
    prompt = ODD[1]
    (row,), _ = tokenizer.encode_prompts([prompt])
    words = " ".join(tokenizer.words[token] for token in row)
    assert "lamp(nobody)" in prompt
    assert " lamp o5" in words, "its slot does not say it"
    assert said(tokenizer, prompt)[3] == "thing#0"


def test_a_text_that_is_broken_off_anywhere_is_read_as_far_as_it_goes(tokenizer: TypedTokenizer) -> None:
    prompt = PROMPT.format(goal="lit(torch)")
    (row,), (rest,), legends = tokenizer.encode_records([prompt], COMPLETIONS[:1])
    whole = [*row.tolist(), *rest.tolist()]
    texts = [tokenizer.decode([whole[:length]], legends)[0] for length in range(len(whole) + 1)]
    assert texts[-1] == f"{prompt} {COMPLETIONS[0]}"
    assert all(text.startswith(prompt) for text in texts[len(row) :]), "what is left out of the prompt is in each"


def test_objects_of_a_kind_have_slots_of_their_own(tokenizer: TypedTokenizer) -> None:
    names = [f"r{number}" for number in range(7)]
    many = "<|startoftext|> <OBJECTS> {} <GOAL> lit(r0) <INIT> {}"
    listed = ", ".join(f"{name} object" for name in names)
    with pytest.raises(TokenizerError, match=r"7 objects of type `room`.* 6 slots(.|\n)*`tokenizer.type_slots` of 7"):
        tokenizer.encode_prompts([many.format(listed, ", ".join(f"room({name})" for name in names))])
    parted = ", ".join(f"{kind}({name})" for kind, name in zip(["room", "lamp"] * 4, names, strict=False))
    assert said(tokenizer, many.format(listed, parted))[-2:] == ["lamp#2", "room#3"]


def test_a_domain_with_types_has_no_such_slots() -> None:
    typed = DOMAIN.replace("(:predicates", "(:types porter) (:predicates")
    assert "room#0" not in of(typed).words
    assert of(TYPED_DOMAIN).words == of(TYPED_DOMAIN, by_predicate=False).words


def test_a_model_of_before_keeps_its_tokens(tmp_path: Path) -> None:
    now, before = of(DOMAIN), of(DOMAIN, by_predicate=False)
    prompt = PROMPT.format(goal="lit(torch)")
    assert said(before, prompt) == [f"object#{number}" for number in range(5)]
    before.save_pretrained(tmp_path)
    settings = read_settings(tmp_path)
    assert not settings.pop("by_predicate")
    write_settings(tmp_path, settings)
    again = TypedTokenizer.load(tmp_path)
    assert again.words == before.words
    assert said(again, prompt) == said(before, prompt)
    now.save_pretrained(tmp_path)
    assert said(TypedTokenizer.load(tmp_path), prompt) == said(now, prompt)


def test_domains_with_and_without_types_share_a_tokenizer() -> None:
    domains = [_native.Domain.parse(text) for text in (TYPED_DOMAIN, DOMAIN)]
    codec = _native.CanonicalCodec.of_domains([(domain, None) for domain in domains])
    both = TypedTokenizer(CanonicalTokenizer(codec, 16), 6)
    assert len(set(both.words)) == len(both.words)
    prompts = [TYPED_PROMPTS[0], PROMPT.format(goal="lit(torch)")]
    listed = [["lamp#0", "room#0", "room#1"], ["room#0", "crate#0", "room#1", "lamp#0", "object#0"]]
    for domain, prompt, expected in zip(domains, prompts, listed, strict=True):
        one = both.of_domain(domain)
        assert said(one, prompt) == expected
        rows, rest, legends = one.encode_records([prompt], COMPLETIONS[:1])
        assert one.decode([[*rows[0], *rest[0]]], legends) == [f"{prompt} {COMPLETIONS[0]}"]


@pytest.mark.parametrize("name", ["goal-area", "o1", "toward-x", "+z"])
def test_a_type_or_predicate_called_like_another_word_has_its_slots(name: str) -> None:
    typed = f"(define (domain d) (:types {name}) (:predicates (p ?x - {name})))"
    untyped = f"(define (domain d) (:predicates ({name} ?x) (p ?x)) (:action a :parameters (?x) :effect (p ?x)))"
    domains = [_native.Domain.parse(text) for text in (typed, untyped)]
    listed = [f"<OBJECTS> a {name} <GOAL> p(a) <INIT> p(a)", f"<OBJECTS> a object <GOAL> p(a) <INIT> {name}(a)"]
    for domain, text in zip(domains, listed, strict=True):
        tokenizer = TypedTokenizer(CanonicalTokenizer(_native.CanonicalCodec(domain), 4), 2)
        (slot,) = said(tokenizer, f"<|startoftext|> {text}")
        assert slot.endswith("#0")
        assert slot.strip("'#0") == name.strip("'")
        (row,), (rest,), legends = tokenizer.encode_records([f"<|startoftext|> {text}"], ["<ACTION> a(a)"])
        assert tokenizer.decode([[*row, *rest]], legends) == [f"<|startoftext|> {text} <ACTION> a(a)"]


def test_under_the_mask_the_automaton_of_plain_words_is_followed(questions: Questions) -> None:
    check_that_the_automaton_of_plain_words_is_followed(of(DOMAIN), questions)


@pytest.mark.parametrize("decode", GUIDED)
def test_guided_texts_that_end_are_valid(questions: Questions, decode: str) -> None:
    check_that_guided_texts_that_end_are_valid(of(DOMAIN), questions, decode)
