"""The canonical tokenizer: lossless, a closed vocabulary, slots last, the same prompt tokens everywhere."""

import pytest

from strips_lm import _native
from strips_lm import tokenizer as tokenizers
from strips_lm.tokenizer import CanonicalTokenizer, TokenizerError, fingerprint

DOMAIN = """(define (domain lamps) (:requirements :strips :typing :negative-preconditions) (:types lamp room)
  (:predicates (lit ?l - lamp) (at ?l - lamp ?r - room))
  (:action light :parameters (?l - lamp) :precondition (not (lit ?l)) :effect (lit ?l))
  (:action carry :parameters (?l - lamp ?a ?b - room) :precondition (at ?l ?a)
    :effect (and (not (at ?l ?a)) (at ?l ?b))))"""
PROMPTS = [
    "<|startoftext|> <OBJECTS> torch lamp, attic room, cellar room <GOAL> lit(torch) <INIT> at(torch, attic)",
    "<|startoftext|> <GOAL> lit(qx_9), at(qx_9, den) <INIT> at(qx_9, hall)",
]
COMPLETIONS = [
    "<ACTION> light(torch) <STATE> lit(torch), at(torch, attic) <|endoftext|>",
    (
        "<ACTION> carry(qx_9, hall, den) <STATE> at(qx_9, den) "
        "<ACTION> light(qx_9) <STATE> lit(qx_9), at(qx_9, den) <|endoftext|>"
    ),
]
BROKEN = ["<ACTION> light(torch <STATE> <|endoftext|>", "<ACTION> fly(qx_9) <STATE> lit(nobody) <|endoftext|>"]


@pytest.fixture(scope="module", params=["difference", "progress", "report"])
def tokenizer(request):
    codec = _native.CanonicalCodec(_native.Domain.parse(DOMAIN), None, layout=request.param)
    return CanonicalTokenizer(codec, max_slots=8)


@pytest.mark.parametrize("completions", [COMPLETIONS, BROKEN])
def test_records_come_back_to_the_byte(tokenizer, completions):
    prompts, rest, legends = tokenizer.encode_records(PROMPTS, completions)
    whole = tokenizer.decode([[*p, *c] for p, c in zip(prompts, rest, strict=True)], legends)
    assert whole == [f"{p} {c}" for p, c in zip(PROMPTS, completions, strict=True)]


def test_a_prompt_has_the_same_tokens_alone_and_in_a_record(tokenizer):
    inside, _, _ = tokenizer.encode_records(PROMPTS, COMPLETIONS, [["light", "carry"]] * 2)
    alone, legends = tokenizer.encode_prompts(PROMPTS)
    assert [row.tolist() for row in inside] == [row.tolist() for row in alone]
    _, completions, _ = tokenizer.encode_records(PROMPTS, COMPLETIONS)
    assert tokenizer.decode_completions(alone, [row.tolist() for row in completions], legends) == COMPLETIONS


def test_slots_are_the_last_ids_and_names_leave_no_trace(tokenizer):
    ((first, count),) = tokenizer.slots
    assert (first + count, count) == (tokenizer.vocab_size, 8)
    assert tokenizer.hf.convert_ids_to_tokens([first, first + 7]) == ["o0", "o7"]
    renamed = [text.replace("torch", "lantern").replace("qx_9", "glim") for text in PROMPTS]
    here, there = (tokenizer.encode_prompts(texts)[0] for texts in (PROMPTS, renamed))
    assert [row.tolist() for row in here] == [row.tolist() for row in there]


def test_transformers_tokenizer_reads_the_codecs_words(tokenizer):
    check_that_transformers_reads_words(tokenizer)


def check_that_transformers_reads_words(tokenizer):
    (row,), _ = tokenizer.encode_prompts(PROMPTS[:1])
    words = tokenizer.hf.convert_ids_to_tokens(row.tolist())
    assert tokenizer.hf(" ".join(words), add_special_tokens=False)["input_ids"] == row.tolist()
    assert len(set(tokenizer.words)) == len(tokenizer.hf) == tokenizer.vocab_size
    assert tokenizer.hf.pad_token_id == tokenizer.end_id == tokenizer.hf.eos_token_id
    assert int(row[0]) == tokenizer.start_id


def test_a_saved_tokenizer_is_the_same(tokenizer, tmp_path):
    check_that_it_can_be_saved(tokenizer, tmp_path)


def check_that_it_can_be_saved(tokenizer, tmp_path):
    tokenizer.save_pretrained(tmp_path)
    again = tokenizers.load(tmp_path)
    assert fingerprint(again) == fingerprint(tokenizer)
    assert again.encode_prompts(PROMPTS)[0][0].tolist() == tokenizer.encode_prompts(PROMPTS)[0][0].tolist()


def test_more_objects_than_slots_are_refused_with_a_hint(tokenizer):
    objects = ", ".join(f"l{i} lamp" for i in range(9))
    with pytest.raises(TokenizerError, match=r"9 objects.* 8 slots(.|\n)*`tokenizer.max_slots` of 9"):
        tokenizer.encode_prompts([f"<|startoftext|> <OBJECTS> {objects} <GOAL> lit(l0) <INIT> lit(l8)"])
