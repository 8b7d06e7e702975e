"""Data sets: the same bytes whatever happens on the way, every label proven, loadable by others."""

from __future__ import annotations

import json
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import time
import tomllib
from collections import Counter
from typing import TYPE_CHECKING

import pyarrow.parquet as pq
import pytest

from strips_lm.cli import main
from strips_lm.sources import read_sources

if TYPE_CHECKING:
    from pathlib import Path

SMALL = [
    "--pairs=600",
    "--seed=7",
    "--set=data.suite_records=60",
    "--set=data.problems_per_template=12",
    "--set=data.random_problems=60",
    "--set=data.states_per_start=200",
    "--set=data.shard_records=100",
    "--set=data.paper_share=0.2",
    "--set=data.shuffled_share=0.2",
]
SPLITS = [
    "train",
    "validation",
    "seen",
    "unseen-objects",
    "unseen-made-up-names",
    "unseen-actions",
    "unseen-shapes",
    "unseen-template",
    "more-objects",
    "longer",
]


def gen_data(out: Path, *extra: str) -> int:
    return main(["gen-data", f"--out={out}", *SMALL, *extra])


def contents(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("data") / "set"
    assert gen_data(out) == 0
    return out


def rows(data: Path, split: str) -> list[dict]:
    files = sorted((data / "data").glob(f"{split.replace('-', '_')}-*.parquet"))
    return [row for file in files for row in pq.read_table(file).to_pylist()]


def test_every_split_is_there_with_consecutive_indices(data: Path) -> None:
    manifest = json.loads((data / "manifest.json").read_text())
    assert list(manifest["splits"]) == SPLITS
    for split, records in manifest["splits"].items():
        assert [row["index"] for row in rows(data, split)] == list(range(records))


def test_every_label_is_proven_from_the_files_alone(data: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["verify-data", str(data)]) == 0
    assert "all of it holds" in capsys.readouterr().err


def test_a_changed_byte_is_found(data: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    copy = shutil.copytree(data, tmp_path / "copy")
    path = copy / "lexicon.toml"
    path.write_bytes(path.read_bytes().replace(b"apple", b"aqple"))
    assert main(["verify-data", str(copy)]) == 1
    assert "lexicon.toml" in capsys.readouterr().out


def test_a_swapped_label_is_found(data: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    copy = shutil.copytree(data, tmp_path / "copy")
    path = next((copy / "data").glob("seen-*.parquet"))
    table = pq.read_table(path)
    names = [{"completion": "negative", "negative": "completion"}.get(name, name) for name in table.column_names]
    pq.write_table(table.rename_columns(names), path)
    assert main(["verify-data", str(copy)]) == 1
    assert "seen 0: the completion is not the plan with its states" in capsys.readouterr().out


@pytest.mark.parametrize("jobs", [1, 2, 8])
def test_any_number_of_jobs_gives_the_same_bytes(data: Path, tmp_path: Path, jobs: int) -> None:
    assert gen_data(tmp_path / "again", f"--jobs={jobs}") == 0
    assert contents(tmp_path / "again") == contents(data)


@pytest.mark.slow
def test_a_killed_run_goes_on_to_the_same_bytes(data: Path, tmp_path: Path) -> None:
    out, draw = tmp_path / "killed", random.Random(5)
    command = [sys.executable, "-m", "strips_lm", "gen-data", f"--out={out}", *SMALL]
    start = time.monotonic()
    subprocess.run([*command, f"--out={tmp_path / 'timed'}"], check=True, stderr=subprocess.DEVNULL)
    whole = time.monotonic() - start
    for _ in range(20):
        run = subprocess.Popen(command, stderr=subprocess.DEVNULL)
        time.sleep(draw.uniform(0.2, 1.0) * whole)
        run.send_signal(signal.SIGKILL)
        run.wait()
        for path in out.glob("data/[!.]*"):
            pq.read_table(path)
        (out / "manifest.json").unlink(missing_ok=True)
        for path in draw.sample(sorted(out.glob("data/[!.]*")), k=min(3, len(list(out.glob("data/[!.]*"))))):
            path.unlink()
    assert gen_data(out) == 0
    written = contents(out)
    written.pop(".lock", None)
    assert written == contents(data)


def test_another_configuration_is_refused_by_name(data: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert gen_data(data, "--seed=8", "--set=data.words_share=0.25") == 2
    message = capsys.readouterr().err
    assert "seed = 7, not 8" in message
    assert "words_share = 0.5, not 0.25" in message


def test_a_second_run_in_the_same_folder_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    import fcntl

    (tmp_path / "set").mkdir()
    with (tmp_path / "set" / ".lock").open("w") as held:
        fcntl.flock(held, fcntl.LOCK_EX)
        assert gen_data(tmp_path / "set") == 2
    assert "another run" in capsys.readouterr().err


def test_a_full_disk_leaves_nothing_under_a_final_name(tmp_path: Path) -> None:
    out = tmp_path / "full"
    limited = f"ulimit -f 40; exec {sys.executable} -m strips_lm gen-data --out {out} {' '.join(SMALL)}"
    run = subprocess.run(["bash", "-c", f"trap '' XFSZ; {limited}"], capture_output=True, text=True, check=False)
    assert run.returncode == 2, run.stderr
    assert not (out / "manifest.json").exists()
    for path in out.glob("data/*.parquet"):
        pq.read_table(path)


def test_show_makes_a_record_anew(data: Path, capsys: pytest.CaptureFixture[str]) -> None:
    wanted = rows(data, "longer")[17]
    assert main(["show", str(data), "17", "--split=longer", "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == wanted


def test_hugging_face_loads_every_split(data: Path, tmp_path: Path) -> None:
    datasets = pytest.importorskip("datasets", reason="the package `datasets` is not installed")
    loaded = datasets.load_dataset(str(data), cache_dir=str(tmp_path))
    assert sorted(loaded) == sorted(split.replace("-", "_") for split in SPLITS)
    assert loaded["train"].num_rows == 500


def test_json_lines_hold_the_same_records(data: Path, tmp_path: Path) -> None:
    assert gen_data(tmp_path / "lines", "--format=jsonl") == 0
    files = sorted((tmp_path / "lines" / "data").glob("train-*.jsonl"))
    lines = [json.loads(line) for file in files for line in file.read_text().splitlines()]
    assert lines == rows(data, "train")


def test_suites_hold_out_names_and_words_of_the_lexicon(data: Path) -> None:
    lexicon = tomllib.loads((data / "lexicon.toml").read_text())
    held_out = {name for words in lexicon["objects"].values() for name in words["held_out"]}
    names = {name for row in rows(data, "unseen-objects") for name in row["names"][1:]}
    assert len(names & held_out) > 20
    trained = {name for split in ("train", "validation", "seen") for row in rows(data, split) for name in row["names"]}
    assert not trained & held_out
    words = {word for row in rows(data, "unseen-actions") for word in row["words"]}
    assert words == {word for action in lexicon["actions"].values() for word in action["held_out"]}


def test_the_lexicon_is_as_large_as_promised() -> None:
    lexicon = tomllib.loads(read_sources("manipulation").texts["lexicon.toml"])
    sizes = {kind: len(words["trained"] + words["held_out"]) for kind, words in lexicon["objects"].items()}
    assert sizes.pop("movable") >= 60
    assert set(sizes) == {"tool", "vessel", "container", "fixture"}
    assert min(sizes.values()) >= 20
    assert any("_" in name for words in lexicon["objects"].values() for name in words["trained"])
    assert all(len(words["trained"]) >= 6 and words["held_out"] for words in lexicon["actions"].values())


@pytest.mark.parametrize(
    ("name", "old", "new", "message"),
    [
        ("templates/stack.pddl", "(on ?a ?s)", "(on ?a ?q)", "stack.pddl:19:24: undeclared variable `?q`"),
        ("templates/stack.pddl", "?b - movable", "?b - mobile", "undeclared type `mobile`"),
        ("templates/reach.pddl", "(:goal (on ?a ?s))", "(:goal (on ?s ?a))", "`?s` is of type fixture"),
        ("templates/brew.pddl", "(opened ?v)", "(opened ?v ?s)", "`opened` takes 1 argument, not 2"),
        ("lexicon.toml", '"apple",', '"apple", "Big Apple",', "lexicon.toml:10:12"),
        ("lexicon.toml", '"hook",', '"hook", "apple",', "`apple` is already"),
        ("lexicon.toml", "[actions.pick]", "[actions.pluck]", "the domain has no action `pluck`"),
        (
            "lexicon.toml",
            "[predicates.in]",
            "[predicates.inn]",
            "lexicon.toml:84:13: the domain has no predicate `inn`",
        ),
        ("lexicon.toml", '"atop",', '"atop", "lift",', "`lift` is already"),
    ],
)
def test_mistakes_are_told_with_their_place(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str, old: str, new: str, message: str
) -> None:
    folder = tmp_path / "domain"
    for file, text in read_sources("manipulation").texts.items():
        (folder / file).parent.mkdir(parents=True, exist_ok=True)
        assert file != name or old in text
        (folder / file).write_text(text.replace(old, new, 1) if file == name else text)
    assert gen_data(tmp_path / "out", f"--domain={folder}") == 2
    assert message in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_any_domain_gives_records_from_one_problem_alone(tmp_path: Path) -> None:
    domain, problem = tmp_path / "d.pddl", tmp_path / "p.pddl"
    domain.write_text(
        "(define (domain lamps) (:requirements :strips) (:predicates (lit ?x) (next ?x ?y))"
        " (:action light :parameters (?x ?y) :precondition (and (next ?x ?y) (lit ?x) (not (lit ?y))) :effect (lit ?y))"
        " (:action douse :parameters (?x) :precondition (lit ?x) :effect (not (lit ?x))))"
    )
    problem.write_text(
        "(define (problem p) (:domain lamps) (:objects a b c d)"
        " (:init (lit a) (next a b) (next b c) (next c d) (next d a)) (:goal (lit d)))"
    )
    out = tmp_path / "out"
    assert (
        main(["gen-data", f"--out={out}", f"--domain={domain}", f"--problems={problem}", "--random-goals", *SMALL]) == 0
    )
    assert main(["verify-data", str(out)]) == 0


LAMPS = (
    "(define (domain lamps) (:requirements :strips) (:predicates (lit ?x) (next ?x ?y))"
    " (:action light :parameters (?x ?y) :precondition (and (next ?x ?y) (lit ?x)) :effect (lit ?y)))"
)


def lamps(folder: Path, name: str, goal: str) -> Path:
    path = folder / name
    path.write_text(
        f"(define (problem p) (:domain lamps) (:objects a b c d)"
        f" (:init (lit a) (next a b) (next b c) (next c d))\n (:goal {goal}))"
    )
    return path


def test_objects_that_a_domain_leaves_to_its_problems_are_not_names_that_suites_hold_out(tmp_path: Path) -> None:
    relight = " (:action relight :parameters () :precondition (lit d) :effect (and (lit a) (not (lit d)))))"
    (tmp_path / "domain.pddl").write_text(LAMPS[:-1] + relight)
    lamps(tmp_path, "p.pddl", "(lit d)")
    out, given = tmp_path / "out", [f"--domain={tmp_path / 'domain.pddl'}", f"--problems={tmp_path / 'p.pddl'}"]
    assert main(["gen-data", f"--out={out}", *given, "--random-goals", *SMALL]) == 0
    assert list((out / "data").glob("unseen_made_up_names-*"))
    assert main(["verify-data", str(out)]) == 0


def test_wide_starts_give_goals_for_the_work_that_they_are(tmp_path: Path) -> None:
    switches = " ".join(f"s{number}" for number in range(12))
    row = " ".join(f"(next s{number} s{number + 1})" for number in range(11))
    (tmp_path / "domain.pddl").write_text(
        "(define (domain switches) (:predicates (on ?x) (next ?x ?y))"
        " (:action flip :parameters (?x) :precondition (not (on ?x)) :effect (on ?x)))"
    )
    (tmp_path / "p.pddl").write_text(
        f"(define (problem p) (:domain switches) (:objects {switches}) (:init {row}) (:goal (on s0)))"
    )
    out, given = tmp_path / "out", [f"--domain={tmp_path / 'domain.pddl'}", f"--problems={tmp_path / 'p.pddl'}"]
    sizes = ["data.states_per_start=14", "data.goals_per_state=4", "data.random_problems=400", "data.suite_records=0"]
    command = ["gen-data", f"--out={out}", *given, "--random-goals", *SMALL, *(f"--set={size}" for size in sizes)]
    assert main(command) == 0
    problems = pq.read_table(out / "problems.parquet").to_pylist()
    starts = Counter(re.search(r"\(:init.*(?=\(:goal)", problem["problem"], re.DOTALL)[0] for problem in problems)
    # From the problem's own state 1 + 12 + 66 are explored, and 4 goals drawn for each 14; from others fewer.
    assert 6 * len(starts) < len(problems)
    assert main(["verify-data", str(out)]) == 0


def test_own_problems_are_used_with_their_goals(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "domain.pddl").write_text(LAMPS)
    lamps(tmp_path, "p1.pddl", "(and (lit b) (lit c))")
    lamps(tmp_path, "p2.pddl", "(lit d)")
    lamps(tmp_path, "p3.pddl", "(lit a)")
    given = ["gen-data", f"--domain={tmp_path / 'domain.pddl'}", f"--problems={tmp_path / 'p*.pddl'}", "--pairs=60"]
    own = ["--set=data.state_goal_share=0.0", "--set=data.unseen_shapes_share=0.0", "--set=data.suite_records=0"]
    out = tmp_path / "out"
    assert main([*given, *own, f"--out={out}"]) == 0
    assert "p3.pddl: its own goal is left out" in capsys.readouterr().err
    problems = pq.read_table(out / "problems.parquet")
    assert problems["shortest"].to_pylist() == [2, 3]
    assert {row["template"] for row in rows(out, "train")} == {"given"}
    assert main(["verify-data", str(out)]) == 0


def test_mistakes_in_own_problems_are_told_before_anything_is_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "domain.pddl").write_text(LAMPS)
    given = ["gen-data", f"--domain={tmp_path / 'domain.pddl'}", f"--out={tmp_path / 'out'}"]
    bad = lamps(tmp_path, "bad.pddl", "(lid d)")
    assert main([*given, f"--problems={bad}"]) == 2
    assert "bad.pddl:2:10: " in capsys.readouterr().err
    assert main([*given, f"--problems={tmp_path / 'q*.pddl'}"]) == 2
    assert "no file fits" in capsys.readouterr().err
    either = lamps(tmp_path, "either.pddl", "(or (lit c) (lit d))")
    assert main([*given, f"--problems={either}"]) == 2
    message = capsys.readouterr().err
    assert (
        "either.pddl:2:9: expected a conjunction of literals, as prompts say goals, found another condition" in message
    )
    assert "\n   (:goal (or (lit c) (lit d))))\n          ^" in message
    assert "hint: `--random-goals`" in message
    assert not (tmp_path / "out").exists()
    assert main([*given, f"--problems={either}", "--random-goals", *SMALL]) == 0


def test_files_that_leave_nothing_to_train_on_are_refused_with_what_else_to_ask_for(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "domain.pddl").write_text(LAMPS)
    given = ["gen-data", f"--domain={tmp_path / 'domain.pddl'}", f"--out={tmp_path / 'out'}"]
    assert main([*given, *SMALL]) == 2
    assert "hint: give problems of the domain by `--problems`" in capsys.readouterr().err
    for number in range(7):
        lamps(tmp_path, f"p{number}.pddl", "(lit d)")
    assert main([*given, f"--problems={tmp_path / 'p*.pddl'}", "--max-steps=2", *SMALL]) == 2
    message = capsys.readouterr().err
    assert "\n  " + str(tmp_path / "p0.pddl") + ": its own goal is left out: no plan of 1 to 2 steps" in message
    assert "p5.pddl" not in message
    assert "\n  … and 2 more\nhint: `--max-steps` asks for longer plans" in message
    dark = tmp_path / "dark.pddl"
    dark.write_text("(define (problem p) (:domain lamps) (:objects a b) (:init (next a b)) (:goal (lit b)))")
    assert main([*given, f"--problems={dark}", "--random-goals", *SMALL]) == 2
    message = capsys.readouterr().err
    assert "hint: no state within reach of the problems makes a goal, either" in message
    assert "--random-goals" not in message
    assert not (tmp_path / "out").exists()


def test_gen_data_never_imports_torch(tmp_path: Path) -> None:
    command = ["gen-data", f"--out={tmp_path / 'set'}", *SMALL]
    code = (
        f"import sys; from strips_lm.cli import main; assert main({command!r}) == 0; assert 'torch' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True, env=os.environ)
