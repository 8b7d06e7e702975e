"""Mixtures: a data set of each domain in one folder, and one model for all of them."""

from __future__ import annotations

import json
import shutil
from typing import TYPE_CHECKING

import numpy as np
import pyarrow.parquet as pq
import pytest

from strips_lm import _native
from strips_lm import tokenizer as tokenizers
from strips_lm.cli import main
from strips_lm.config import ConfigError, RunConfig, presets
from strips_lm.dataset import open_data, open_split
from strips_lm.folders import data_sets
from strips_lm.mixture import configurations
from strips_lm.sources import built_in_domains
from strips_lm.tokenizer import CanonicalTokenizer, SpelledTokenizer, TokenizerError

if TYPE_CHECKING:
    from pathlib import Path

DOMAINS = ("ferry", "gripper", "hanoi")
FEW = [
    *("--seed=3", "--set=data.suite_records=12", "--set=data.problems_per_template=8"),
    *("--set=data.random_problems=40", "--set=data.states_per_start=150"),
]
SHARES = {name: 2.0 if name == "ferry" else 1.0 if name in DOMAINS else 0.0 for name in built_in_domains()}
TINY = ["model.layers=2", "model.width=32", "model.context=400", "train.minutes=0", "train.steps=6"]


def gen_data(out: Path, *more: str) -> int:
    return main(["gen-data", f"--out={out}", *FEW, *more])


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("mixture") / "all"
    shares = ", ".join(f"{name} = {share}" for name, share in SHARES.items())
    assert gen_data(out, "--domain=all", "--pairs=240", f"--set=data.shares={{ {shares} }}") == 0
    return out


@pytest.fixture(scope="module")
def run(data: Path) -> Path:
    """A model of all domains, hardly trained."""
    out = data.parent / "run"
    sets = [f"--set={setting}" for setting in TINY]
    assert main(["train", str(data), f"--out={out}", "--preset=all", *sets]) == 0
    return out


def records(folder: Path, split: str = "train") -> list[dict]:
    return [row for path in sorted((folder / "data").glob(f"{split}-*")) for row in pq.read_table(path).to_pylist()]


def domain(folder: Path) -> _native.Domain:
    return _native.Domain.parse((folder / "domain.pddl").read_bytes(), "domain.pddl")


def test_each_domain_has_its_share_as_a_data_set_of_its_own(data: Path, tmp_path: Path) -> None:
    assert [folder.name for folder in data_sets(data)] == list(DOMAINS)
    for name, pairs in zip(DOMAINS, (120, 60, 60), strict=True):
        assert gen_data(tmp_path / name, f"--domain={name}", f"--pairs={pairs}") == 0
        for path in (path for path in (tmp_path / name).rglob("*") if path.is_file()):
            assert path.read_bytes() == (data / path.relative_to(tmp_path)).read_bytes(), path


def test_a_mixture_is_finished_once_and_belongs_to_its_configuration(data: Path, capsys) -> None:
    before = {path: path.stat().st_mtime_ns for path in data.rglob("*.parquet")}
    assert gen_data(data, "--domain=all", "--pairs=241") == 2
    assert "pairs = 240, not 241" in capsys.readouterr().err
    assert before == {path: path.stat().st_mtime_ns for path in data.rglob("*.parquet")}


def test_all_of_it_is_proven_and_a_part_put_in_from_elsewhere_is_found(data: Path, tmp_path: Path, cli) -> None:
    assert cli("verify-data", data).out == ""
    copy = shutil.copytree(data, tmp_path / "copy")
    shutil.rmtree(copy / "hanoi")
    shutil.copytree(data / "ferry", copy / "hanoi")
    found = cli("verify-data", copy)
    assert (found.code, found.out) == (1, "hanoi/manifest.json: not the file that the manifest describes\n")
    (path,) = (copy / "gripper" / "data").glob("seen-*")
    path.write_bytes(path.read_bytes()[:-1])
    assert "gripper: data/seen" in cli("verify-data", copy).out


def test_what_a_mixture_cannot_be_is_said_by_name(cli, data: Path) -> None:
    with pytest.raises(ConfigError, match=r"no domain `fery`\nhint: did you mean `ferry`"):
        configurations(RunConfig.load("all", ["data.shares={ fery = 2.0 }"]))
    with pytest.raises(ConfigError, match="are of one domain"):
        configurations(RunConfig.load("all", ['data.problems=["p.pddl"]']))
    with pytest.raises(ConfigError, match="leave no domain"):
        configurations(RunConfig.load("all", [f"data.shares.{name}=0.0" for name in built_in_domains()]))
    found = cli("show", data, 0)
    assert (found.code, "give the folder of one: ferry, gripper, hanoi" in found.err) == (2, True)


def test_suites_are_those_of_the_default_that_are_there_or_the_named_ones(cli, run: Path, data: Path) -> None:
    few = ("--limit", 1, "--set", "evaluate.pairs=1", "--json", run.parent / "found.json")
    for folder, prefix in ((data / "gripper", ""), (data, "gripper/")):
        assert cli("evaluate", run, "--data", folder, *few).code == 0
        scored = {score["suite"] for score in json.loads((run.parent / "found.json").read_text())["scores"]}
        assert {f"{prefix}seen", f"{prefix}longer"} < scored
        assert f"{prefix}unseen-template" not in scored
    found = cli("evaluate", run, "--data", data / "gripper", *few)
    assert "gripper: no suite `unseen-template`, left out" in found.err
    for folder in (data / "gripper", data):
        found = cli("evaluate", run, "--data", folder, "--suite", "unseen-template", *few)
        assert (found.code, "no suite `unseen-template`" in found.err) == (2, True)


def test_words_are_shared_and_the_domain_says_how_many_objects_they_take(data: Path, tmp_path: Path) -> None:
    whole = CanonicalTokenizer.of_data(data, 32, "difference")
    alone = [CanonicalTokenizer.of_data(data / name, 32, "difference") for name in DOMAINS]
    assert set(whole.words) == set().union(*(one.words for one in alone))
    whole.save_pretrained(tmp_path)
    again = tokenizers.load(tmp_path)
    for name, one in zip(DOMAINS, alone, strict=True):
        rows = records(data / name)
        prompts, completions = [row["prompt"] for row in rows], [row["completion"] for row in rows]
        speaker = again.of_domain(domain(data / name))
        asked, said, legends = speaker.encode_records(prompts, completions, [row["words"] for row in rows])
        theirs, _, _ = one.encode_records(prompts, completions, [row["words"] for row in rows])
        assert [[one.words[i] for i in row] for row in theirs] == [[whole.words[i] for i in row] for row in asked]
        assert speaker.decode_completions(asked, [row.tolist() for row in said], legends) == completions
    with pytest.raises(TokenizerError, match="which of the tokenizer's domains"):
        again.encode_prompts(["<|startoftext|> <GOAL>"])
    with pytest.raises(TokenizerError, match="trained on `ferry, gripper, hanoi`"):
        again.of_domain(_native.Domain.parse("(define (domain d) (:predicates (p)))"))


def test_a_tokenizer_of_one_domain_takes_parts_of_it_and_nothing_else(data: Path) -> None:
    one = CanonicalTokenizer.of_data(data / "hanoi", 32, "difference")
    assert one.of_domain(domain(data / "hanoi")) is one
    assert one.of_domain(_native.Domain.parse("(define (domain part) (:predicates))")) is one
    with pytest.raises(TokenizerError, match=r"trained on `hanoi`, and .* of `ferry` are not the same"):
        one.of_domain(domain(data / "ferry"))


def test_a_mixtures_names_cannot_be_spelled(data: Path) -> None:
    with pytest.raises(TokenizerError, match="one domain"):
        SpelledTokenizer.of_data(data, [], 320)


def test_a_mixtures_records_are_those_of_its_data_sets_spread_evenly(data: Path) -> None:
    tokenizer = CanonicalTokenizer.of_data(data, 32, "difference")
    mixed = open_data(data, "train", tokenizer, 400)
    parts = [open_split(data / d, "train", tokenizer.of_domain(domain(data / d)), 400) for d in DOMAINS]
    assert len(mixed) == sum(map(len, parts)) == 200
    place = 0
    for name, part in zip(DOMAINS, parts, strict=True):
        for record in range(len(part.index)):
            for kind in ("prompts", "positives", "negatives"):
                assert np.array_equal(getattr(mixed, kind)[place], getattr(part, kind)[record])
            assert mixed.label(place) == f"{name} {record}"
            place += 1
    assert sorted(mixed.kept.tolist()) == list(range(place))
    assert mixed.lengths.tolist() == [length for part in parts for length in part.lengths]
    for count in (8, 40, 100):
        names = [mixed.label(record).split()[0] for record in mixed.kept[:count]]
        shares = zip(DOMAINS, (0.5, 0.25, 0.25), strict=True)
        assert all(abs(names.count(name) - share * count) <= 1 for name, share in shares)


def test_one_model_is_scored_on_every_domain(run: Path, data: Path, tmp_path: Path, cli) -> None:
    few = ["--limit=4", "--set=evaluate.pairs=4", "--set=evaluate.examples=1"]
    ways = ["--decode=greedy", "--decode=masked", "--suite=seen", "--suite=more-objects"]
    found = cli("evaluate", run, "--data", data, *few, *ways, "--json", tmp_path / "results.json")
    assert found.code == 0, found.err
    results = json.loads((tmp_path / "results.json").read_text())
    suites = ["ferry/seen", "ferry/more-objects", "gripper/seen", "gripper/more-objects", "hanoi/seen"]
    assert list(dict.fromkeys(score["suite"] for score in results["scores"])) == suites
    for score in results["scores"]:
        if score["decode"] == "masked":
            assert score["valid"] == score["prompts"] - score["unfinished"]
            assert not score["malformed"]
    assert all(len(example["outputs"]) == len(["greedy", "masked"]) for example in results["examples"])
    assert found.out.count("│ hanoi ") >= 2
    assert cli("evaluate", "--reproduce", tmp_path / "results.json").code == 0
    assert cli("report", tmp_path / "results.json", "--out", tmp_path / "report.html").code == 0
    assert "hanoi, greedy" in (tmp_path / "report.html").read_text(encoding="utf-8")
    wrong = cli("evaluate", run, "--data", data, "--suite=sean")
    assert (wrong.code, "did you mean `seen`" in wrong.err) == (2, True)


def test_the_problem_says_which_domain_is_asked(run: Path, data: Path, tmp_path: Path, cli, cups) -> None:
    for name in DOMAINS:
        problems = pq.read_table(data / name / "problems.parquet").to_pylist()
        easiest = min(problems, key=lambda row: row["shortest"])
        (tmp_path / f"{name}.pddl").write_text(easiest["problem"])
        found = cli(
            *("generate", run, data / name / "domain.pddl", tmp_path / f"{name}.pddl", "--decode=search", "--json")
        )
        assert (found.code, json.loads(found.out)["valid"]) == (0, True), found.err
    found = cli("generate", run, *cups.args())
    assert (found.code, "was trained on `ferry, gripper, hanoi`" in found.err) == (2, True)


def test_training_leaves_the_data_as_it_was_and_names_its_domains(run: Path, data: Path, cli) -> None:
    assert (data / "hanoi" / "tokens").is_dir()
    assert cli("verify-data", data / "hanoi").out == ""
    assert "| domains | ferry, gripper, hanoi |" in (run / "best" / "README.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("name", presets())
def test_every_preset_is_a_configuration(name: str) -> None:
    assert RunConfig.load(name).model.layers > 0
