"""Names in pieces: lossless, in pieces that no word is taken for, and drawn anew without changing what a text says."""

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from strips_lm import _native
from strips_lm.spelling import Spelling
from strips_lm.tokenizer import CanonicalTokenizer, SpelledTokenizer, TokenizerError, fingerprint
from strips_lm.tokenizer.spelled import learn_pieces
from test_tokenizer_canonical import (
    BROKEN,
    COMPLETIONS,
    DOMAIN,
    PROMPTS,
    check_that_it_can_be_saved,
    check_that_transformers_reads_words,
)

KNOWN = ["lantern", "torch", "torch_2", "attic", "cellar", "kitchen", "light", "lamp", "room"] * 3


@pytest.fixture(scope="module", params=[False, True], ids=["", "types"])
def tokenizer(request):
    codec = _native.CanonicalCodec.of_domains([(_native.Domain.parse(DOMAIN), None)], kinds=request.param)
    return SpelledTokenizer(CanonicalTokenizer(codec, 64), learn_pieces(KNOWN, 300))


@pytest.mark.parametrize("completions", [COMPLETIONS, BROKEN])
def test_records_come_back_to_the_byte(tokenizer, completions):
    prompts, rest, legends = tokenizer.encode_records(PROMPTS, completions)
    whole = tokenizer.decode([[*p, *c] for p, c in zip(prompts, rest, strict=True)], legends)
    assert whole == [f"{p} {c}" for p, c in zip(PROMPTS, completions, strict=True)]
    alone, legends = tokenizer.encode_prompts(PROMPTS)
    assert [row.tolist() for row in prompts] == [row.tolist() for row in alone]
    if completions is COMPLETIONS:
        assert tokenizer.decode_completions(alone, rest, legends) == COMPLETIONS


NAMES = st.lists(st.from_regex(r"[a-zé][a-z0-9_-]{0,12}", fullmatch=True), min_size=2, max_size=2, unique=True)


@settings(max_examples=80, deadline=None)
@given(names=NAMES)
def test_any_names_come_back_to_the_byte(tokenizer, names):
    lamp, room = names
    prompt = f"<|startoftext|> <OBJECTS> {lamp} lamp, {room} room <GOAL> lit({lamp}) <INIT> at({lamp}, {room})"
    text = f"<ACTION> light({lamp}) <STATE> lit({lamp}), at({lamp}, {room}) <|endoftext|>"
    prompts, completions, legends = tokenizer.encode_records([prompt], [text])
    assert tokenizer.decode_completions(prompts, completions, legends) == [text]
    pieces = [tokenizer.hf.convert_ids_to_tokens(tokenizer.spell(name)) for name in names]
    assert all(first.startswith("Ġ") and all(piece.startswith("##") for piece in rest) for first, *rest in pieces)


def test_a_name_that_no_object_has_is_decoded_as_it_was_written(tokenizer):
    (prompt,), legends = tokenizer.encode_prompts(PROMPTS[:1])
    words = dict(zip(tokenizer.words, range(tokenizer.vocab_size), strict=True))
    written = [words["<ACTION>"], words["light"], *tokenizer.spell("torchlight"), tokenizer.end_id]
    texts = tokenizer.decode_completions([prompt], [written], legends)
    assert texts == ["<ACTION> light(torchlight) <|endoftext|>"]
    said = [piece for name in ("zz", "attic", "y") for piece in tokenizer.spell(name)]
    again = [words["<ACTION>"], words["carry"], *said]
    assert tokenizer.decode_completions([prompt], [again], legends) == ["<ACTION> carry(zz, attic, y)"]
    assert tokenizer.say(again, legends[0]) == "<ACTION> carry zz attic y"


def test_a_type_stands_before_each_mention_where_that_is_asked_for(tokenizer):
    _, (row, _), (legend, _) = tokenizer.encode_records(PROMPTS, COMPLETIONS)
    said = tokenizer.hf.convert_ids_to_tokens(row.tolist())
    kind = ["lamp"] if tokenizer.slotted.kinds else []
    name = tokenizer.hf.convert_ids_to_tokens(tokenizer.spell("torch"))
    assert said == ["<ACTION>", "light", *kind, *name, "<STATE>", "+lit", *kind, *name, "<|endoftext|>"]
    assert tokenizer.say(row.tolist()[:-1], legend) == "<ACTION> light torch <STATE> +lit torch"


def test_any_tokens_are_decoded(tokenizer):
    rng = np.random.default_rng(0)
    prompts, legends = tokenizer.encode_prompts(PROMPTS)
    for _ in range(200):
        rows = [rng.integers(tokenizer.vocab_size, size=30) for _ in prompts]
        assert len(tokenizer.decode_completions(prompts, rows, legends)) == len(prompts)


def test_transformers_tokenizer_reads_the_words(tokenizer):
    check_that_transformers_reads_words(tokenizer)


def test_a_saved_tokenizer_is_the_same(tokenizer, tmp_path):
    check_that_it_can_be_saved(tokenizer, tmp_path)
    assert json.loads((tmp_path / "plan_tokenizer.json").read_text())["kind"] == "spelled"


def test_names_alone_make_its_pieces_another_tokenizer(tokenizer):
    other = SpelledTokenizer(tokenizer.slotted, learn_pieces(["mirror"] * 9, 300))
    assert fingerprint(other) != fingerprint(tokenizer)


def test_texts_of_another_domain_are_refused(tokenizer):
    other = _native.Domain.parse("(define (domain d) (:predicates (on ?x)))")
    with pytest.raises(TokenizerError, match="lamps"):
        tokenizer.of_domain(other)


def slotted(tokenizer):
    prompts, completions, _ = tokenizer.slotted.encode_records(PROMPTS, COMPLETIONS)
    return [[prompt, completion, completion[:5]] for prompt, completion in zip(prompts, completions, strict=True)]


def read_back(spelling, parts):
    """The twin: each run of pieces is a name; names are numbered as they come."""
    slots, rows = {}, []
    begins = set(spelling.begins.tolist())
    for part in parts:
        row, name = [], []
        for token in [*part.tolist(), 0]:
            if name and (token < spelling.first_slot or token in begins):
                row.append(spelling.first_slot + slots.setdefault(tuple(name), len(slots)))
                name = []
            if token < spelling.first_slot:
                row.append(token)
            else:
                name.append(token)
        rows.append(row[:-1])
    return rows


@pytest.mark.parametrize("short_share", [0.0, 0.5, 1.0])
def test_drawn_names_say_the_same_of_other_objects(tokenizer, short_share):
    spelling = tokenizer.spelling(200)
    rng = np.random.default_rng(1)
    seen = set()
    for _ in range(200):
        for parts in slotted(tokenizer):
            spelled = spelling.spell(parts, rng, short_share)
            assert read_back(spelling, spelled) == [part.tolist() for part in parts]
            seen.add(tuple(spelled[0].tolist()))
            if short_share == 1.0:
                assert [len(row) for row in spelled] == [len(part) for part in parts]
    assert len(seen) > (100 if short_share == 1.0 else 390)


def test_names_that_would_make_a_record_too_long_have_one_piece(tokenizer):
    rng = np.random.default_rng(2)
    for parts in slotted(tokenizer):
        most = len(parts[0]) + len(parts[1])
        for _ in range(50):
            spelled = tokenizer.spelling(most).spell(parts, rng)
            assert len(spelled[0]) + len(spelled[1]) <= most


def test_many_objects_and_few_pieces_still_get_names_of_their_own():
    spelling = Spelling(10, np.array([10]), np.array([11]), 10_000)
    parts = [np.arange(10, 40), np.arange(10, 40)]
    spelled = spelling.spell(parts, np.random.default_rng(3), 0.5)
    assert read_back(spelling, spelled) == [part.tolist() for part in parts]
    tight = Spelling(10, np.array([10]), np.array([11]), 60)
    with pytest.raises(_native.DataError, match="vocab_size"):
        tight.spell(parts, np.random.default_rng(3))
