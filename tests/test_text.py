"""The canonical codec and constrained decoding, as Python sees them."""

from __future__ import annotations

import pickle
import random
from importlib.resources import files
from itertools import pairwise

import numpy as np
import pytest

from strips_lm import _native

FOLDER = files("strips_lm") / "domains" / "manipulation"
DOMAIN = _native.Domain.parse((FOLDER / "domain.pddl").read_text(encoding="utf-8"))
LEXICON = (FOLDER / "lexicon.toml").read_text(encoding="utf-8")
PROBLEM = _native.Problem.parse(
    """(define (problem brew) (:domain manipulation) (:objects teabag - movable cup - vessel shelf - fixture)
    (:init (inworkspace table) (inworkspace teabag) (inworkspace cup) (on teabag shelf) (on cup shelf))
    (:goal (and (on teabag cup) (on cup table) (opened cup))))""",
    DOMAIN,
)
PROMPT = (
    "<|startoftext|> <OBJECTS> bench fixture, zorg movable, ülk vessel, shelf fixture <GOAL> on(zorg, ülk), "
    "on(ülk, bench), opened(ülk) <INIT> inworkspace(bench), inworkspace(zorg), inworkspace(ülk), "
    "on(zorg, shelf), on(ülk, shelf)"
)
NAMES = ["bench", "zorg", "ülk", "shelf"]
COMPLETION = "<ACTION> lift(ülk) <STATE> inhand(ülk), inworkspace(bench), inworkspace(zorg), inworkspace(ülk)"


@pytest.mark.parametrize("layout", ["difference", "progress", "report"])
def test_the_codec_loses_no_byte(layout: str) -> None:
    codec = _native.CanonicalCodec(DOMAIN, LEXICON, layout=layout)  # type: ignore[arg-type]
    texts = [PROMPT, f"{PROMPT} {COMPLETION}", f"{PROMPT} {COMPLETION[:50]}", "", "<STATE>  x"]
    words, legends = codec.encode(texts)
    assert codec.decode(words, legends) == texts
    assert codec.decode(words, pickle.loads(pickle.dumps(legends))) == texts
    again = _native.CanonicalCodec.from_json(codec.to_json())
    assert again.encode(texts) == (words, legends)


def test_ids_are_places_in_the_vocabulary() -> None:
    codec = _native.CanonicalCodec(DOMAIN, LEXICON)
    vocabulary = codec.vocabulary(8)
    texts = [PROMPT, f"{PROMPT} {COMPLETION}"]
    ids, offsets, prompts, legends = codec.encode_ids(texts)
    rows = [" ".join(vocabulary[i] for i in ids[a:b]) for a, b in pairwise(offsets)]
    assert (rows, legends) == codec.encode(texts)
    assert vocabulary[codec.first_slot] == "o0"
    prompt, completion = np.split(ids[offsets[1] :], [prompts[1]])
    assert codec.decode_completions([prompt.tolist()], [completion.tolist()], [legends[1]]) == [COMPLETION]


def test_side_information_must_fit() -> None:
    codec = _native.CanonicalCodec(DOMAIN, LEXICON)
    with pytest.raises(ValueError, match="1 words for 2 rows"):
        codec.encode(["", ""], [["pick"]])
    with pytest.raises(ValueError, match="goal style `x`"):
        codec.encode([""], goal_styles=["x"])
    with pytest.raises(_native.DataError, match="not a saved codec"):
        _native.CanonicalCodec.from_json("{}")


@pytest.mark.parametrize("stop_at_goal", [True, False])
def test_masked_texts_that_end_are_valid_plans(stop_at_goal: bool) -> None:
    codec = _native.CanonicalCodec(DOMAIN, LEXICON)
    vocabulary = codec.vocabulary(8)
    ids, _, _, (legend,) = codec.encode_ids([PROMPT])
    task = _native.Task(DOMAIN, PROBLEM)
    decoder = _native.MaskedDecoder(codec, vocabulary, stop_at_goal=stop_at_goal)
    first, forced = decoder.add([task] * 40, [legend] * 40, [NAMES] * 40)
    texts, rows, draw = dict(enumerate(forced)), list(range(first, first + 40)), random.Random(1)
    while rows := [row for row, is_at in zip(rows, decoder.status(rows), strict=True) if is_at == "open"]:
        mask = decoder.mask(rows)
        tokens = [draw.choice(np.flatnonzero(allowed).tolist()) for allowed in mask]
        for row, token, more in zip(rows, tokens, decoder.advance(rows, tokens), strict=True):
            texts[row] += [token, *more]
    ended = [row for row in texts if decoder.status([row]) == ["ended"]]
    assert ended
    made = codec.decode_completions([ids.tolist()] * 40, list(texts.values()), [legend] * 40)
    for row, text in zip(texts, made, strict=True):
        read = _native.parse_completions([text])[0]
        assert read.malformed is None
        assert read.finished == (row in ended)
        verdict = task.validate("\n".join(decoder.plan(row)))
        assert verdict.is_valid == (row in ended)
        assert len(read.steps) == len(decoder.plan(row))


def test_a_token_that_is_not_allowed_is_refused() -> None:
    codec = _native.CanonicalCodec(DOMAIN, LEXICON)
    _, (legend,) = codec.encode([PROMPT])
    decoder = _native.MaskedDecoder(codec, codec.vocabulary(8))
    row, _ = decoder.add([_native.Task(DOMAIN, PROBLEM)], [legend], [NAMES])
    with pytest.raises(ValueError, match="token 0 may not come here"):
        decoder.advance([row], [0])
    with pytest.raises(ValueError, match="no row 7"):
        decoder.mask([7])
    with pytest.raises(ValueError, match="no token for the word"):
        _native.MaskedDecoder(codec, ["x"]).add([_native.Task(DOMAIN, PROBLEM)], [legend], [NAMES])
