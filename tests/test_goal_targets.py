"""What atoms are to the goal: held against the texts, read slowly; its loss against a plain one; and a whole run."""

from __future__ import annotations

import json
import math
import re
import signal
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow.parquet as pq
import pytest
import torch
from safetensors.torch import load_file
from transformers import GPT2DoubleHeadsModel, GPT2LMHeadModel

from strips_lm.batches import Dress, Plan, Row, build_step, collate
from strips_lm.cli import main
from strips_lm.config import RunConfig
from strips_lm.dataset import open_split
from strips_lm.goal_targets import GoalReader
from strips_lm.loss import batch_losses, weighted
from strips_lm.tokenizer.canonical import CanonicalTokenizer
from strips_lm.tokenizer.typed import TypedTokenizer
from strips_lm.train import train
from test_model_forward import gpt2
from test_train import interrupt_at

if TYPE_CHECKING:
    from pathlib import Path

SMALL = [
    "--pairs=300",
    "--seed=5",
    "--set=data.suite_records=20",
    "--set=data.problems_per_template=8",
    "--set=data.random_problems=120",
    "--set=data.states_per_start=150",
]


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out: Path = tmp_path_factory.mktemp("data") / "set"
    assert main(["gen-data", f"--out={out}", *SMALL]) == 0
    return out


def literals(text: str) -> list[str]:
    """The literals of a list, as they stand there."""
    return re.findall(r"(?:not )?[\w-]+\([^()]*\)", text)


def slowly(row: dict[str, Any]) -> list[str]:
    """What each atom of a record's states is to its goal, in order, by its text and its goal's style."""
    goal = set(literals(row["prompt"].split("<GOAL>")[1].split("<INIT>")[0]))
    states = [row["prompt"].split("<INIT>")[1]]
    states += [re.split("<ACTION>|<.endoftext.>", part)[0] for part in row["completion"].split("<STATE>")[1:]]
    lists = [literals(state) for state in states]
    whole = row["goal_style"] == "state" or goal == set(lists[-1])
    return [
        "<GOAL>" if atom in goal else "<not>" if whole or f"not {atom}" in goal else "<STATE>"
        for atoms in lists
        for atom in atoms
    ]


@pytest.mark.parametrize("kind", ["canonical", "typed"])
def test_targets_are_what_the_texts_say(data: Path, kind: str) -> None:
    plain = CanonicalTokenizer.of_data(data, 32, "report")
    tokenizer = plain if kind == "canonical" else TypedTokenizer(plain, 24)
    reader = GoalReader.of(tokenizer)
    assert reader is not None
    table = pq.read_table(data / "data").to_pylist()
    texts = [[row[name] for row in table] for name in ("prompt", "completion", "words")]
    prompts, completions, _ = tokenizer.encode_records(*texts)
    owner, places, found = reader.targets(list(zip(prompts, completions, strict=True)))
    styles = set()
    for number, row in enumerate(table):
        mine = owner == number
        assert [tokenizer.words[target] for target in found[mine]] == slowly(row)
        tokens = np.concatenate((prompts[number], completions[number]))
        after = np.append(tokens[1:], tokenizer.end_id)[places[mine]]
        assert (after < plain.codec.first_slot).all(), "an atom's last token has none of its objects behind it"
        styles.add(row["goal_style"])
    assert len(styles) > 1
    assert {tokenizer.words[target] for target in found} == {"<GOAL>", "<not>", "<STATE>"}


@pytest.mark.parametrize("layout", ["difference", "progress"])
def test_changes_have_no_targets(data: Path, layout: Any) -> None:
    assert GoalReader.of(CanonicalTokenizer.of_data(data, 32, layout)) is None


READER = GoalReader(goal=2, init=3, state=5, others=(0, 1, 4), negation=6, strange=(7,), first_slot=20)


def read(*rows: tuple[list[int], list[int]]) -> list[list[tuple[int, int]]]:
    """(place, target) of each atom of each row."""
    owner, places, found = READER.targets(
        [(np.array(a, dtype=np.uint16), np.array(b, dtype=np.uint16)) for a, b in rows]
    )
    return [
        [(int(p), int(t)) for o, p, t in zip(owner, places, found, strict=True) if o == n] for n in range(len(rows))
    ]


def test_an_atom_is_its_predicate_and_its_objects_in_order() -> None:
    prompt = [1, 2, 10, 20, 21, 6, 11, 3, 10, 21, 20, 11]
    plan = [4, 12, 20, 5, 10, 20, 21, 10, 20, 11, 0]
    assert read((prompt, plan)) == [[(10, 5), (11, 6), (18, 2), (20, 5), (21, 6)]]


def test_a_goal_that_the_plan_ends_in_to_the_atom_wants_nothing_else() -> None:
    prompt = [1, 2, 10, 20, 11, 3, 10, 20, 10, 21]
    done, more = [4, 12, 5, 10, 20, 11, 0], [4, 12, 5, 10, 20, 11, 12, 0]
    assert read((prompt, done))[0] == [(7, 2), (9, 6), (14, 2), (15, 2)]
    assert read((prompt, more))[0] == [(7, 2), (9, 5), (14, 2), (15, 2), (16, 5)]
    assert read((prompt, more), (prompt, done))[1] == read((prompt, done))[0], "whatever stands beside it"


def test_a_record_with_something_else_than_atoms_has_no_targets() -> None:
    prompt, plan = [1, 2, 10, 20, 3, 10, 20], [4, 12, 5, 11, 0]
    strange = [1, 2, 7, 3, 10, 20]
    assert read((strange, plan), (prompt, plan), (prompt, [4, 7, 5, 11, 0])) == [[], [(6, 2), (10, 5)], []]


def test_empty_states_and_goals_are_read() -> None:
    assert read(([1, 2, 3], [0])) == [[]]
    assert read(([1, 2, 3, 10, 20], [4, 12, 5, 0])) == [[(4, 6)]]
    assert read(([1, 2, 10, 20, 3], [4, 12, 5, 10, 20, 0])) == [[(9, 2)]]


def some_rows(data: Path) -> tuple[list[tuple[Any, Any, Any]], GoalReader]:
    """(prompt, plan, wrong plan) of records, and their reader."""
    tokenizer = CanonicalTokenizer.of_data(data, 32, "report")
    split = open_split(data, "train", tokenizer, 10_000)
    reader = GoalReader.of(tokenizer)
    assert reader is not None
    short = [record for record in split.kept if split.lengths[record] < 64][:9]
    assert len(short) == 9
    return [tuple(np.asarray(part) for part in split.parts(record)) for record in short], reader


def plainly(model: Any, records: list[tuple[Any, Any, Any]], reader: GoalReader) -> Any:
    """The loss by transformers' own forward pass, one record and one atom at a time."""
    found, scored = 0.0, 0
    for prompt, plan, _ in records:
        ids = torch.from_numpy(np.concatenate((prompt, plan)).astype(np.int64))[None]
        half = model(ids, output_hidden_states=True).hidden_states[model.config.n_layer // 2]
        logits = model.lm_head(model.transformer.ln_f(half))[0].log_softmax(-1)
        _, places, targets = reader.targets([(prompt, plan)])
        found = found - sum(logits[place, target] for place, target in zip(places, targets, strict=True))
        scored += len(plan)
    return found / scored


@pytest.mark.parametrize("kind", [GPT2DoubleHeadsModel, GPT2LMHeadModel])
@pytest.mark.parametrize(("cut", "spread", "borrow"), [(9, math.inf, False), (2, 0.0, True), (4, 0.2, False)])
def test_loss_and_gradient_equal_the_slow_twin(data: Path, kind: Any, cut: int, spread: float, borrow: bool) -> None:
    records, reader = some_rows(data)
    model = gpt2(kind, vocab_size=90, n_positions=400, n_layer=3).double()
    plainly(model, records, reader).backward()
    wanted = {name: p.grad.clone() for name, p in model.named_parameters() if p.grad is not None}
    model.zero_grad()
    batches = []
    for start in range(0, len(records), cut):
        rows, pairs = [], []
        for prompt, plan, wrong in records[start : start + cut]:
            rows.append(Row(prompt, plan, scored=True))
            if kind is GPT2DoubleHeadsModel:
                rows.append(Row(prompt, wrong, scored=False))
                pairs.append([len(rows) - 2, len(rows) - 1])
        batches.append(collate(rows, pairs, 0, spread, borrow=borrow, reader=reader))
    losses = [batch_losses(model, batch, torch.float64) for batch in batches]
    tokens = sum(part.tokens for part in losses)
    sum(weighted(part, tokens, len(records), 0.0, 0.0, goal_weight=1.0) for part in losses).backward()
    for name, parameter in model.named_parameters():
        if name in wanted:
            torch.testing.assert_close(parameter.grad, wanted[name], rtol=1e-6, atol=1e-9, msg=name)
        else:
            assert parameter.grad is None or torch.count_nonzero(parameter.grad) == 0, name


def test_renumbered_records_have_targets_of_their_own_atoms(data: Path) -> None:
    tokenizer = CanonicalTokenizer.of_data(data, 32, "report")
    split = open_split(data, "train", tokenizer, 10_000)
    split = replace(split, goal_reader=GoalReader.of(tokenizer))
    plan = Plan(step_tokens=1, step_pairs=0, batch_tokens=100_000)
    steps = [build_step(split, split.kept[:40], plan, Dress(0.0, share), (3,)) for share in (0.0, 1.0)]
    plain, renumbered = (step.batches[0] for step in steps)
    assert not torch.equal(plain.input_ids, renumbered.input_ids)
    assert torch.equal(plain.goal_positions, renumbered.goal_positions)
    assert torch.equal(plain.goal_labels, renumbered.goal_labels)


def settings(*more: str) -> RunConfig:
    sizes = ("model.layers=2", "model.width=32", "train.minutes=0", "train.step_tokens=1500", "train.mc_start=0.0")
    return RunConfig.load("tiny", [*sizes, "train.evaluate_every=0.5", "train.validation_records=10", *more])


def weights(out: Path) -> dict[str, torch.Tensor]:
    return load_file(out / "last" / "model.safetensors")


def losses_of(out: Path) -> list[float | None]:
    lines = [json.loads(line) for line in (out / "metrics.jsonl").read_text().splitlines()]
    return [line["goal_loss"] for line in lines if line["kind"] == "train"]


def test_a_run_learns_what_atoms_are_to_the_goal_and_leaves_a_plain_model(data: Path, tmp_path: Path) -> None:
    given = settings("tokenizer.layout=report", "train.steps=60", "train.lr=0.01")
    assert given.train.goal_weight == 1.0
    assert train(given, data, tmp_path / "told", shown=False) == 0
    found = losses_of(tmp_path / "told")
    assert found[-1] is not None
    assert found[0] is not None
    assert found[-1] < 0.5 * found[0]
    untold = settings("tokenizer.layout=report", "train.steps=1", "train.goal_weight=0.0")
    assert train(untold, data, tmp_path / "untold", shown=False) == 0
    assert losses_of(tmp_path / "untold") == []
    assert weights(tmp_path / "told").keys() == weights(tmp_path / "untold").keys()
    _, report = GPT2DoubleHeadsModel.from_pretrained(tmp_path / "told" / "last", output_loading_info=True)
    assert not any(report[name] for name in ("missing_keys", "unexpected_keys", "mismatched_keys"))


@pytest.mark.parametrize("kind", ["double-head", "lm-head"])
def test_a_resumed_run_ends_where_an_uninterrupted_one_does(
    data: Path, tmp_path: Path, kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    given = settings("tokenizer.layout=report", "train.steps=8", f"model.kind={kind}")
    train(given, data, tmp_path / "whole", shown=False)
    interrupt_at(5, monkeypatch)
    assert train(given, data, tmp_path / "pieced", shown=False) == signal.SIGTERM
    monkeypatch.undo()
    assert train(given, data, tmp_path / "pieced", resumed=True, shown=False) == 0
    whole, pieced = weights(tmp_path / "whole"), weights(tmp_path / "pieced")
    assert all(torch.equal(whole[name], pieced[name]) for name in whole)


@pytest.mark.parametrize("more", [("tokenizer.layout=progress",), ("tokenizer.layout=report", "model.kind=lstm")])
def test_where_nothing_is_told_the_weight_changes_nothing(data: Path, tmp_path: Path, more: tuple[str, ...]) -> None:
    for weight in ("0.0", "1.0"):
        given = settings("train.steps=10", f"train.goal_weight={weight}", *more)
        assert train(given, data, tmp_path / weight, shown=False) == 0
    assert losses_of(tmp_path / "1.0") == [None]
    with_, without = weights(tmp_path / "1.0"), weights(tmp_path / "0.0")
    assert all(torch.equal(with_[name], without[name]) for name in without)
