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
from strips_lm.goal_targets import GoalReader, GoalTargets
from strips_lm.loss import batch_losses, weighted
from strips_lm.tokenizer.canonical import CanonicalTokenizer
from strips_lm.tokenizer.typed import TypedTokenizer
from strips_lm.train import train
from test_model_forward import gpt2
from test_train import interrupt_at
from test_train_processes import same_weights
from test_train_processes import train as train_in

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


def told(reader: GoalReader, *rows: tuple[Any, Any]) -> GoalTargets:
    """The targets of (prompt, completion) rows, one behind the other."""
    tokens = [np.concatenate(row) for row in rows]
    return reader.targets(tokens, [0, *np.cumsum([len(row) for row in tokens]).tolist()[:-1]])


def literals(text: str) -> list[str]:
    """The literals of a list, as they stand there."""
    return re.findall(r"(?:not )?[\w-]+\([^()]*\)", text)


def slowly(row: dict[str, Any]) -> tuple[list[str], list[set[str]]]:
    """What each atom of a record's states is to its goal, and the words of what the goal lacks after each state."""
    goal = set(literals(row["prompt"].split("<GOAL>")[1].split("<INIT>")[0]))
    states = [row["prompt"].split("<INIT>")[1]]
    states += [re.split("<ACTION>|<.endoftext.>", part)[0] for part in row["completion"].split("<STATE>")[1:]]
    lists = [literals(state) for state in states]
    whole = row["goal_style"] == "state" or goal == set(lists[-1])
    gone = [{atom for atom in atoms if f"not {atom}" in goal or (whole and atom not in goal)} for atoms in lists]
    missing = [{atom for atom in goal if not atom.startswith("not ") and atom not in atoms} for atoms in lists]
    relations = [
        "<GOAL>" if atom in goal else "<not>" if atom in unwanted else "<STATE>"
        for atoms, unwanted in zip(lists, gone, strict=True)
        for atom in atoms
    ]
    words = [
        {word for atom in unmet | unwanted for word in re.findall(r"[^\s(),]+", atom)}
        | ({"<not>"} if unwanted else set())
        for unmet, unwanted in zip(missing, gone, strict=True)
    ]
    return relations, [found or {"<|endoftext|>"} for found in words]


@pytest.mark.parametrize("kind", ["canonical", "typed"])
def test_targets_are_what_the_texts_say(data: Path, kind: str) -> None:
    plain = CanonicalTokenizer.of_data(data, 32, "report")
    tokenizer = plain if kind == "canonical" else TypedTokenizer(plain, 24)
    reader = GoalReader.of(tokenizer)
    assert reader is not None
    table = pq.read_table(data / "data").to_pylist()
    texts = [[row[name] for row in table] for name in ("prompt", "completion", "words")]
    prompts, completions, legends = tokenizer.encode_records(*texts)
    styles, seen = set(), set()
    for row, prompt, completion, legend in zip(table, prompts, completions, legends, strict=True):
        found = told(reader, (prompt, completion))
        relations, lacking = slowly(row)
        assert [tokenizer.words[target] for target in found.relations.tolist()] == relations
        said = [tokenizer.say([word], legend) for word in found.words.tolist()]
        pairs = list(zip(found.lacking.tolist(), said, strict=True))
        assert [{word for state, word in pairs if state == number} for number in range(len(lacking))] == lacking
        assert len(pairs) == len(set(pairs))
        tokens = [tokenizer.words[token] for token in (*prompt, *completion, tokenizer.end_id)]
        assert all(tokens[place + 1] in {"<ACTION>", "<|endoftext|>"} for place in found.states.tolist())
        assert all(tokens[place + 1] not in tokenizer.words[plain.codec.first_slot :] for place in found.atoms.tolist())
        styles.add(row["goal_style"])
        seen.update(relations, *lacking)
    assert len(styles) > 1
    assert seen >= {"<GOAL>", "<not>", "<STATE>", "<|endoftext|>"}


def test_rows_are_read_as_if_alone(data: Path) -> None:
    records, reader = some_rows(data)
    rows = [(prompt, plan) for prompt, plan, _ in records]
    together, start, first = told(reader, *rows), 0, 0
    for prompt, plan in rows:
        alone, places = told(reader, (prompt, plan)), range(start, start + len(prompt) + len(plan))
        for name in ("atoms", "states"):
            assert [p - start for p in getattr(together, name).tolist() if p in places] == getattr(alone, name).tolist()
        atoms = torch.isin(together.atoms, torch.tensor(places))
        assert together.relations[atoms].tolist() == alone.relations.tolist()
        words = (together.lacking >= first) & (together.lacking < first + len(alone.states))
        assert (together.lacking[words] - first).tolist() == alone.lacking.tolist()
        assert together.words[words].tolist() == alone.words.tolist()
        start, first = places.stop, first + len(alone.states)


@pytest.mark.parametrize("layout", ["difference", "progress"])
def test_changes_have_no_targets(data: Path, layout: Any) -> None:
    assert GoalReader.of(CanonicalTokenizer.of_data(data, 32, layout)) is None


READER = GoalReader(2, 3, 5, frozenset(range(6)), negation=6, strange=frozenset({7}), first_slot=20, end=0)


def read(*rows: tuple[list[int], list[int]]) -> tuple[list[tuple[int, int]], list[tuple[int, list[int]]]]:
    """(place, relation) of each atom, (place, words of what is lacking) of each state."""
    found = told(READER, *((np.array(a, dtype=np.uint16), np.array(b, dtype=np.uint16)) for a, b in rows))
    lacking = [found.words[found.lacking == number].tolist() for number in range(len(found.states))]
    return list(zip(found.atoms.tolist(), found.relations.tolist(), strict=True)), list(
        zip(found.states.tolist(), lacking, strict=True)
    )


def test_an_atom_is_its_predicate_and_its_objects_in_order() -> None:
    prompt = [1, 2, 10, 20, 21, 6, 11, 3, 10, 21, 20, 11]
    plan = [4, 12, 20, 5, 10, 20, 21, 10, 20, 11, 0]
    atoms, states = read((prompt, plan))
    assert atoms == [(10, 5), (11, 6), (18, 2), (20, 5), (21, 6)]
    assert states == [(11, [6, 10, 11, 20, 21]), (21, [6, 11])]


def test_a_goal_that_the_plan_ends_in_to_the_atom_wants_nothing_else() -> None:
    prompt = [1, 2, 10, 20, 11, 3, 10, 20, 10, 21]
    done, more = [4, 12, 5, 10, 20, 11, 0], [4, 12, 5, 10, 20, 11, 12, 0]
    assert read((prompt, done)) == ([(7, 2), (9, 6), (14, 2), (15, 2)], [(9, [6, 10, 11, 21]), (15, [0])])
    assert read((prompt, more)) == ([(7, 2), (9, 5), (14, 2), (15, 2), (16, 5)], [(9, [11]), (16, [0])])


def test_a_record_with_something_else_than_atoms_has_no_targets() -> None:
    prompt, plan = [1, 2, 10, 20, 3, 10, 20], [4, 12, 5, 11, 0]
    strange = [1, 2, 7, 3, 10, 20]
    assert read((strange, plan), (prompt, plan), (prompt, [4, 7, 5, 11, 0])) == (
        [(17, 2), (21, 5)],
        [(17, [0]), (21, [10, 20])],
    )
    assert read((strange, plan)) == ([], [])


def test_empty_states_and_goals_are_read() -> None:
    assert read(([1, 2, 3], [0])) == ([], [(2, [0])])
    assert read(([1, 2, 3, 10, 20], [4, 12, 5, 0])) == ([(4, 6)], [(4, [6, 10, 20]), (7, [0])])
    assert read(([1, 2, 10, 20, 3], [4, 12, 5, 10, 20, 0])) == ([(9, 2)], [(4, [10, 20]), (9, [0])])


LAYERS = 4


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
    """The loss by transformers' own forward pass, one record, one atom and one word at a time."""
    found, scored = 0.0, 0
    for prompt, plan, _ in records:
        ids = torch.from_numpy(np.concatenate((prompt, plan)).astype(np.int64))[None]
        layers = model(ids, output_hidden_states=True).hidden_states
        half, late = (
            model.lm_head(model.transformer.ln_f(layers[at]))[0].log_softmax(-1)
            for at in (LAYERS // 2, 3 * LAYERS // 4)
        )
        goal = told(reader, (prompt, plan))
        found = found - sum(half[place, target] for place, target in zip(goal.atoms, goal.relations, strict=True))
        for number, place in enumerate(goal.states):
            words = goal.words[goal.lacking == number]
            found = found + sum(math.log(1 / len(words)) - late[place, word] for word in words) / len(words)
        scored += len(plan)
    return found / scored


@pytest.mark.parametrize("kind", [GPT2DoubleHeadsModel, GPT2LMHeadModel])
@pytest.mark.parametrize(("cut", "spread", "borrow"), [(9, math.inf, False), (2, 0.0, True), (4, 0.2, False)])
def test_loss_and_gradient_equal_the_slow_twin(data: Path, kind: Any, cut: int, spread: float, borrow: bool) -> None:
    records, reader = some_rows(data)
    model = gpt2(kind, vocab_size=90, n_positions=400, n_layer=LAYERS).double()
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
    assert plain.goal is not None
    assert renumbered.goal is not None
    assert all(torch.equal(*parts) for parts in zip(plain.goal[:4], renumbered.goal[:4], strict=True))
    assert not torch.equal(plain.goal.words, renumbered.goal.words)


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


@pytest.mark.slow
@pytest.mark.parametrize("more", ["train.shard=false", "train.shard=true"])
def test_two_processes_learn_what_one_does(data: Path, tmp_path: Path, more: str) -> None:
    run = tmp_path / "given.toml"
    given = ("tokenizer.layout=report", "train.optimizer=adam", "train.precision=float32", "train.batch_tokens=700")
    settings(*given, "train.steps=6", more).save(run)
    for world in (1, 2):
        train_in(data, tmp_path / str(world), run, world)
    same_weights(weights(tmp_path / "1"), weights(tmp_path / "2"), 1e-4)


@pytest.mark.parametrize("more", [("tokenizer.layout=progress",), ("tokenizer.layout=report", "model.kind=lstm")])
def test_where_nothing_is_told_the_weight_changes_nothing(data: Path, tmp_path: Path, more: tuple[str, ...]) -> None:
    for weight in ("0.0", "1.0"):
        given = settings("train.steps=10", f"train.goal_weight={weight}", *more)
        assert train(given, data, tmp_path / weight, shown=False) == 0
    assert losses_of(tmp_path / "1.0") == [None]
    with_, without = weights(tmp_path / "1.0"), weights(tmp_path / "0.0")
    assert all(torch.equal(with_[name], without[name]) for name in without)
