"""The suite `large`: problems of any size, plans that are valid, shortest lengths only where they are proven."""

from __future__ import annotations

import json
from importlib.resources import files
from typing import TYPE_CHECKING

import pyarrow.parquet as pq
import pytest

from strips_lm import _native
from strips_lm.cli import main
from strips_lm.evaluate.suites import DataFolder
from strips_lm.evaluate.tally import Trial, tally

if TYPE_CHECKING:
    from pathlib import Path

SIZES = {
    "blocksworld": ("block", [8]),
    "driverlog": ("parcel", [4]),
    "ferry": ("car", [7]),
    "gripper": ("ball", [9]),
    "hanoi": ("disc", [5]),
    "logistics": ("package", [3]),
    "manipulation": ("movable", [4]),
    "visitall": ("cell", [4, 5]),
}
FEW = [
    "--pairs=60",
    "--seed=2",
    "--set=data.suite_records=0",
    "--set=data.random_problems=40",
    "--set=data.large_records=12",
]


def gen_data(out: Path, domain: str, *more: str) -> int:
    kind, size = SIZES[domain]
    return main(
        ["gen-data", f"--out={out}", f"--domain={domain}", *FEW, f"--set=data.large_sizes={{{kind}={size}}}", *more]
    )


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("data") / "set"
    assert gen_data(out, "gripper") == 0
    return out


def large(data: Path) -> list[dict]:
    return pq.read_table(data / "data" / "large-00000-of-00001.parquet").to_pylist()


def test_every_domain_has_a_template_for_large_problems() -> None:
    folders = [folder for folder in (files("strips_lm") / "domains").iterdir() if folder.is_dir()]
    assert sorted(SIZES) == sorted(folder.name for folder in folders if (folder / "large.pddl").is_file())
    assert len(SIZES) == len(folders)


@pytest.mark.parametrize("domain", sorted(SIZES))
def test_problems_are_of_the_size_asked_for_and_every_label_is_proven(tmp_path: Path, domain: str) -> None:
    assert gen_data(tmp_path / "set", domain) == 0
    assert main(["verify-data", str(tmp_path / "set")]) == 0
    kind, size = SIZES[domain]
    folder = DataFolder(tmp_path / "set")
    for item in folder.items("large"):
        objects = _native.Problem.parse(folder.problem(item), folder.domain).objects
        wanted = size[0] if len(size) == 1 else size[0] * size[1]
        assert sum(found == kind for _, found in objects) == wanted
    assert json.loads((tmp_path / "set" / "manifest.json").read_text())["splits"]["large"] == 12


def test_a_shortest_length_is_null_or_the_oracles(data: Path) -> None:
    folder, rows = DataFolder(data), large(data)
    lengths = pq.read_table(data / "problems.parquet")["shortest"].to_pylist()
    assert {row["template"] for row in rows} == {"large"}
    assert any(row["optimal_steps"] is None for row in rows)
    for row, item in zip(rows, folder.items("large", distinct=False), strict=True):
        assert row["optimal_steps"] == lengths[row["problem_id"]]
        assert item.optimal_steps == (-1 if row["optimal_steps"] is None else row["optimal_steps"])
        if row["optimal_steps"] is not None:
            plan = folder.task(item).shortest_plan(max_steps=row["optimal_steps"])
            assert plan is not None
            assert len(plan) == row["optimal_steps"] == row["steps"]


def test_evaluation_compares_only_with_lengths_that_are_known(data: Path) -> None:
    folder = DataFolder(data)
    items = folder.items("large", distinct=False)
    problems, words = [folder.problem(item) for item in items], [folder.words(item) for item in items]
    judged = _native.judge(folder.domain, problems, [item.completion for item in items], words)
    trial = Trial(
        model="m",
        suite="large",
        decode="greedy",
        oracle_helps=False,
        texts=[item.completion for item in items],
        finished=[True] * len(items),
        optimal_steps=[item.optimal_steps for item in items],
        tokens=1,
        seconds=1.0,
        verify_seconds=1.0,
    )
    score = tally(trial, judged)
    known = sum(item.optimal_steps >= 0 for item in items)
    assert (score.valid, score.optimal, score.comparable, score.optimum_known) == (12, known, known, known)


def test_the_suite_changes_nothing_else(data: Path, tmp_path: Path) -> None:
    assert gen_data(tmp_path / "off", "gripper", "--set=data.large_records=0", "--set=data.large_sizes={}") == 0
    for split in ("train", "validation"):
        name = f"{split}-00000-of-00001.parquet"
        assert (data / "data" / name).read_bytes() == (tmp_path / "off" / "data" / name).read_bytes()


def test_json_lines_say_null_too(tmp_path: Path) -> None:
    assert gen_data(tmp_path / "lines", "gripper", "--format=jsonl") == 0
    lines = (tmp_path / "lines" / "data" / "large-00000-of-00001.jsonl").read_text().splitlines()
    assert any(json.loads(line)["optimal_steps"] is None for line in lines)


@pytest.mark.parametrize(
    ("sizes", "message"),
    [
        ("{room=[3]}", "`data.large_sizes` gives sizes of `room`"),
        ("{ball=[3, 3]}", "no array with as many dimensions"),
        ("{ball=[0]}", "gives sizes of `ball`"),
    ],
)
def test_sizes_of_nothing_are_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], sizes: str, message: str
) -> None:
    assert gen_data(tmp_path / "out", "gripper", f"--set=data.large_sizes={sizes}") == 2
    assert message in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("(20)", "(0)", "large.pddl:5:17: expected a positive number"),
        ("(each ?b", "(every ?b", "large.pddl:5:22: expected `(each ?x …)`"),
        ("array ball", "array balls", "large.pddl:5:11: undeclared type `balls`"),
        ("(in ?b ?here)", "(in ?c ?here)", "undeclared variable `?c`"),
    ],
)
def test_mistakes_in_arrays_are_told_with_their_place(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], old: str, new: str, message: str
) -> None:
    from strips_lm.sources import read_sources

    for file, text in read_sources("gripper").texts.items():
        (tmp_path / "domain" / file).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "domain" / file).write_text(text.replace(old, new, 1) if file == "large.pddl" else text)
    asked = ["gen-data", f"--out={tmp_path / 'out'}", f"--domain={tmp_path / 'domain'}", *FEW]
    assert main(asked) == 2
    assert message in capsys.readouterr().err
