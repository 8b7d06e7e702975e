"""What `verify-data` finds: any one cell of any column that is not as it was made."""

from __future__ import annotations

import json
import random
from typing import TYPE_CHECKING, Any

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from strips_lm.cli import main
from strips_lm.storage import file_digest
from strips_lm.suites import Found, Hashes, shared
from strips_lm.verify import _Checker, _stream

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

SMALL = [
    "--pairs=240",
    "--seed=11",
    "--set=data.suite_records=24",
    "--set=data.problems_per_template=8",
    "--set=data.random_problems=40",
    "--set=data.states_per_start=150",
    "--set=data.paper_share=0.3",
    "--set=data.shuffled_share=0.3",
]
TEXTS = ["prompt", "completion", "negative", "plan"]
UNPROVABLE = ["seed", "plan_count"]
"""Columns that only `run.toml` can account for."""
COLUMNS = ["index", "negative_kind", "negative_verdict", "negative_step", "problem_id", "names", "words", "template"]
COLUMNS += ["style", "goal_style", "steps", "optimal_steps"]


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("data") / "set"
    assert main(["gen-data", f"--out={out}", *SMALL]) == 0
    return out


@pytest.fixture(scope="module")
def checker(data: Path) -> _Checker:
    return _Checker(data)


def seen(data: Path) -> pa.Table:
    return pq.read_table(data / "data" / "seen-00000-of-00001.parquet")


def with_cell(table: pa.Table, column: str, row: int, value: Any) -> pa.Table:
    values = table[column].to_pylist()
    assert values[row] != value
    values[row] = value
    place = table.column_names.index(column)
    return table.set_column(place, column, pa.array(values, table.schema.field(column).type))


def other(value: Any) -> Any:
    if isinstance(value, list):
        return [*value[:-1], f"{value[-1]}x"]
    return value + 1 if isinstance(value, int) else f"{value}x"


@pytest.mark.parametrize("column", [*TEXTS, *COLUMNS])
def test_a_changed_cell_is_found_by_the_oracle_alone(data: Path, checker: _Checker, column: str) -> None:
    rows, draw = seen(data), random.Random(column)
    # The report's style does not say the words of actions that the plan does without.
    typed = [row for row, style in enumerate(rows["style"].to_pylist()) if style == "typed"]
    for row in draw.sample(typed, 4):
        changed = with_cell(rows, column, row, other(rows[column][row].as_py()))
        assert f"seen {row}: " in " ".join(checker.check("seen", 0, changed, Found(), None))


@pytest.mark.parametrize("column", TEXTS)
def test_any_changed_character_is_found_by_the_oracle_alone(data: Path, checker: _Checker, column: str) -> None:
    rows, draw = seen(data), random.Random(column)
    for _ in range(40):
        row = draw.randrange(rows.num_rows)
        text = rows[column][row].as_py()
        at = draw.randrange(len(text))
        put = draw.choice([letter for letter in "abcx_ ,()<\n" if letter != text[at]])
        changed = with_cell(rows, column, row, draw.choice([text[:at], text[:at] + put]) + text[at + 1 :])
        assert checker.check("seen", 0, changed, Found(), None), (text, at, put)


@pytest.mark.parametrize("column", [*TEXTS, "names", "words", "negative_kind", "negative_verdict", "style"])
def test_a_cell_of_another_record_is_found_by_the_oracle_alone(data: Path, checker: _Checker, column: str) -> None:
    rows, draw = seen(data), random.Random(column)
    values = rows[column].to_pylist()
    typed = [row for row, style in enumerate(rows["style"].to_pylist()) if style == "typed"]
    pairs = [(a, b) for a in typed for b in range(len(values)) if values[a] != values[b]]
    for row, from_row in draw.sample(pairs, 10):
        assert checker.check("seen", 0, with_cell(rows, column, row, values[from_row]), Found(), None), (row, from_row)


@pytest.mark.parametrize("column", UNPROVABLE)
def test_what_no_oracle_can_prove_is_made_again(data: Path, checker: _Checker, column: str) -> None:
    rows = seen(data)
    changed = with_cell(rows, column, 5, other(rows[column][5].as_py()))
    assert checker.check("seen", 0, changed, Found(), _stream(data)) == [
        f"seen 5: `{column}` is not what run.toml gives"
    ]


@pytest.mark.parametrize("column", ["problem_id", "domain", "num_objects", "canonical_hash", "template", "shortest"])
def test_a_changed_problem_is_found(data: Path, checker: _Checker, column: str) -> None:
    table = checker._table
    changed = with_cell(table, column, 3, other(table[column][3].as_py()))
    checker._table, checker._problems = changed, changed.to_pylist()
    try:
        assert any(fault.startswith("problem") for fault in checker.problem_faults(_stream(data)))
    finally:
        checker._table, checker._problems = table, table.to_pylist()


def test_a_changed_file_with_its_hash_put_right_is_found(data: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = data / "data" / "seen-00000-of-00001.parquet"
    manifest_path, before = data / "manifest.json", path.read_bytes()
    manifest_text = manifest_path.read_text()
    manifest = json.loads(manifest_text)
    pq.write_table(with_cell(seen(data), "seed", 2, 7), path)
    manifest["files"]["data/seen-00000-of-00001.parquet"] = file_digest(path)
    manifest_path.write_text(json.dumps(manifest))
    assert main(["verify-data", str(data)]) == 1
    assert capsys.readouterr().out == "seen 2: `seed` is not what run.toml gives\n"
    path.write_bytes(before)
    manifest_path.write_text(manifest_text)
    assert main(["verify-data", str(data)]) == 0


def test_what_a_suite_holds_out_must_not_be_trained() -> None:
    trained = Found({"cup"}, {"lift"}, {"00"}, {"brew"}, {3, 4}, {5}, {5}, Hashes([1, 2]))
    assert not shared({"train": trained, "longer": Found(lengths={6}), "more-objects": Found(sizes={5})})
    assert shared({"train": trained, "longer": Found(lengths={5})})
    assert shared({"train": trained, "more-objects": Found(sizes={4})})
    assert shared({"train": trained, "unseen-template": Found(templates={"brew"})})
    assert shared({"train": trained, "unseen-objects": Found(names={"cup"})})
    assert shared({"train": trained, "unseen-actions": Found(words={"lift"})})
    assert shared({"train": trained, "unseen-shapes": Found(problems={"00"})})
    twice = Found(texts=Hashes([3, 2, 2]))
    assert shared({"train": trained, "seen": twice}) == ["seen: 1 records are in train as well"]
    assert Hashes([3, 2, 3, 3]).repeated() == [2, 3]


@pytest.fixture(scope="module")
def lines(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("data") / "lines"
    assert main(["gen-data", f"--out={out}", "--format=jsonl", *SMALL]) == 0
    return out


def test_json_lines_are_proven_as_parquet_is(lines: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["verify-data", str(lines)]) == 0
    records = sum(len(path.read_text().splitlines()) for path in lines.glob("data/*.jsonl"))
    assert f"{records:,} records checked" in capsys.readouterr().err


def test_show_makes_a_line_anew(lines: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["show", str(lines), "17", "--split=seen", "--json"]) == 0
    (path,) = lines.glob("data/seen-*.jsonl")
    assert capsys.readouterr().out == path.read_text().splitlines()[17] + "\n"


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        (lambda row: {**row, "seed": row["seed"] ^ 1}, "`seed` is not what run.toml gives"),
        (lambda row: {**row, "completion": row["negative"]}, "the completion is not the plan with its states"),
        (lambda row: {**row, "more": 1}, "seen-00000-of-00001.jsonl:4: other fields than a record has"),
        (lambda row: {**row, "steps": "two"}, "seen-00000-of-00001.jsonl: "),
        (lambda row: [*row], "seen-00000-of-00001.jsonl:4: other fields than a record has"),
    ],
)
def test_a_changed_line_is_found(
    lines: Path, change: Callable[[dict[str, Any]], Any], complaint: str, capsys: pytest.CaptureFixture[str]
) -> None:
    (path,) = lines.glob("data/seen-*.jsonl")
    before = path.read_text()
    rows = before.splitlines()
    rows[3] = json.dumps(change(json.loads(rows[3])))
    path.write_text("\n".join(rows) + "\n")
    try:
        assert main(["verify-data", str(lines)]) == 1
        assert complaint in capsys.readouterr().out
        path.write_text(before[:-5])
        assert main(["verify-data", str(lines)]) == 1
        assert "seen-00000-of-00001.jsonl:24: " in capsys.readouterr().out
    finally:
        path.write_text(before)
