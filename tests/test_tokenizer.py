"""Byte-level BPE both ways: what is decoded is what was encoded, and the vocabulary counts what the report's does."""

import itertools
import json

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import blocks_data
from strips_lm import tokenizer as tokenizers
from strips_lm.dataset import read_rows, split_files, texts
from strips_lm.tokenizer import END, SPECIAL, BpeTokenizer, TokenizerError, fingerprint

SETTINGS = settings(max_examples=60, deadline=None)


def save_gpt2_shaped(folder, size=50_257):
    """A byte-level BPE of GPT-2's size and layout, made on the spot: 256 bytes, 50,000 merges, one end token."""
    from tokenizers import Tokenizer, decoders, models, pre_tokenizers
    from transformers import PreTrainedTokenizerFast

    alphabet = sorted(pre_tokenizers.ByteLevel.alphabet())
    letters = "etaonisrhldcumfpgwybvkxjqz"
    pairs = [a + b for a, b in itertools.product(letters, repeat=2)]
    wanted = size - 1 - len(alphabet) - len(pairs)
    longer = [(a, b) for _, (a, b) in zip(range(wanted), itertools.product(pairs, repeat=2), strict=False)]
    merges = [tuple(pair) for pair in pairs] + longer
    words = [*alphabet, *map("".join, merges), END]
    model = models.BPE({word: index for index, word in enumerate(words)}, merges)
    backend = Tokenizer(model)
    backend.pre_tokenizer = pre_tokenizers.ByteLevel(add_prefix_space=False)
    backend.decoder = decoders.ByteLevel()
    PreTrainedTokenizerFast(tokenizer_object=backend, eos_token=END, bos_token=END).save_pretrained(folder)
    return folder


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return blocks_data.write(tmp_path_factory.mktemp("blocks"), train=60, validation=10)


@pytest.fixture(scope="module", params=["gpt2", "trained"])
def bpe(request, folder, tmp_path_factory):
    if request.param == "gpt2":
        return BpeTokenizer.pretrained(str(save_gpt2_shaped(tmp_path_factory.mktemp("gpt2"))))
    return BpeTokenizer.train(texts(folder), 320)


def test_gpt2_with_our_tokens_counts_50264(tmp_path):
    tokenizer = BpeTokenizer.pretrained(str(save_gpt2_shaped(tmp_path)))
    assert tokenizer.vocab_size == 50_264
    assert tokenizer.end_id == 50_256
    assert [tokenizer.hf.convert_tokens_to_ids(word) for word in SPECIAL] == list(range(50_257, 50_264))
    assert tokenizer.hf.pad_token_id == tokenizer.hf.eos_token_id == tokenizer.end_id


def test_records_come_back_to_the_byte(bpe, folder):
    for batch in read_rows(split_files(folder, "train"), ("prompt", "completion")):
        prompts, completions, legends = bpe.encode_records(batch["prompt"], batch["completion"])
        whole = bpe.decode([[*p, *c] for p, c in zip(prompts, completions, strict=True)], legends)
        assert whole == [f"{p} {c}" for p, c in zip(batch["prompt"], batch["completion"], strict=True)]
        assert bpe.decode_completions(prompts, completions, legends) == batch["completion"]


def test_a_prompt_has_the_same_tokens_alone_and_in_a_record(bpe, folder):
    batch = next(read_rows(split_files(folder, "train"), ("prompt", "completion")))
    inside, _, _ = bpe.encode_records(batch["prompt"], batch["completion"])
    alone, _ = bpe.encode_prompts(batch["prompt"])
    assert all((a == b).all() for a, b in zip(inside, alone, strict=True))


@SETTINGS
@given(st.text(st.characters(exclude_categories=("Cs",)), max_size=60))
def test_any_text_comes_back_to_the_byte(text):
    tokenizer = BpeTokenizer.train(["on(cup, table)"], 320)
    ids, legends = tokenizer.encode_prompts([text])
    assert tokenizer.decode(ids, legends) == [text]


def test_special_tokens_are_single_tokens(bpe):
    for word in (END, *SPECIAL):
        assert len(bpe.encode_prompts([word])[0][0]) == 1
    ids, _ = bpe.encode_prompts(["<|startoftext|> <GOAL> on(a, b) <INIT> on(b, a) <ACTION>"])
    named = bpe.hf.convert_ids_to_tokens(ids[0].tolist())
    assert [word for word in named if word in SPECIAL] == ["<|startoftext|>", "<GOAL>", "<INIT>", "<ACTION>"]


def test_a_saved_tokenizer_is_the_same(bpe, tmp_path):
    bpe.save_pretrained(tmp_path)
    again = tokenizers.load(tmp_path)
    assert fingerprint(again) == fingerprint(bpe)
    text = "<|startoftext|> <GOAL> on(red, blue) <INIT> on(blue, red) <|endoftext|>"
    assert again.encode_prompts([text])[0][0].tolist() == bpe.encode_prompts([text])[0][0].tolist()
    assert (again.start_id, again.end_id, again.vocab_size) == (bpe.start_id, bpe.end_id, bpe.vocab_size)
    assert json.loads((tmp_path / "plan_tokenizer.json").read_text())["kind"] == "bpe"


def test_a_folder_without_a_tokenizer_says_so(tmp_path):
    with pytest.raises(TokenizerError, match=r"no plan_tokenizer\.json"):
        tokenizers.load(tmp_path)
    with pytest.raises(TokenizerError, match="no tokenizer"):
        BpeTokenizer.pretrained(str(tmp_path / "nowhere"))
