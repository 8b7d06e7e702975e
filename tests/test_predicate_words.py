"""Words for predicates: said in the legend, the same throughout a record, and put back wherever a text is judged."""

from __future__ import annotations

import json
import tomllib
from typing import TYPE_CHECKING

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from strips_lm import _native
from strips_lm.cli import main
from strips_lm.evaluate.suites import DataFolder
from strips_lm.suites import Found, shared
from strips_lm.tokenizer.canonical import CanonicalTokenizer
from strips_lm.verify import _Checker

if TYPE_CHECKING:
    from pathlib import Path

SMALL = [
    "--pairs=120",
    "--seed=4",
    "--set=data.suite_records=20",
    "--set=data.problems_per_template=8",
    "--set=data.random_problems=40",
    "--set=data.states_per_start=150",
    "--set=data.paper_share=0.2",
]
PREDICATES = ["inhand", "inworkspace", "on", "in", "opened"]


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("data") / "set"
    assert main(["gen-data", f"--out={out}", *SMALL, "--set=data.predicate_words=0.5"]) == 0
    return out


def rows(data: Path, split: str) -> list[dict]:
    return pq.read_table(data / "data" / f"{split}-00000-of-00001.parquet").to_pylist()


def test_the_data_set_is_proven_from_its_files(data: Path) -> None:
    assert main(["verify-data", str(data)]) == 0


def test_words_are_trained_ones_but_in_the_suite_that_holds_them_out(data: Path) -> None:
    lexicon = tomllib.loads((data / "lexicon.toml").read_text())["predicates"]
    assert list(lexicon) == PREDICATES
    lists = {kind: {word for words in lexicon.values() for word in words[kind]} for kind in ("trained", "held_out")}
    trained = {
        word for split in ("train", "seen", "unseen_shapes") for row in rows(data, split) for word in row["words"][5:]
    }
    assert trained == lists["trained"]
    assert {word for row in rows(data, "unseen_predicates") for word in row["words"][5:]} == lists["held_out"]
    drawn = [row["words"][5:] != PREDICATES for row in rows(data, "train") if "<VOCAB>" in row["prompt"]]
    assert 0.3 < sum(drawn) / len(drawn) < 0.7
    assert all(row["words"][5:] == PREDICATES for row in rows(data, "train") if "<VOCAB>" not in row["prompt"])


def test_without_the_knob_nothing_but_words_is_different(data: Path, tmp_path: Path) -> None:
    assert main(["gen-data", f"--out={tmp_path / 'off'}", *SMALL]) == 0
    assert "unseen-predicates" not in json.loads((tmp_path / "off" / "manifest.json").read_text())["splits"]
    for with_words, without in zip(rows(data, "train"), rows(tmp_path / "off", "train"), strict=True):
        assert without["words"] == with_words["words"][:5]
        same = {key: value for key, value in without.items() if key != "words"}
        if with_words["words"][5:] == PREDICATES and "inhand inhand" not in with_words["prompt"]:
            assert same == {key: value for key, value in with_words.items() if key != "words"}
        assert (same["plan"], same["names"]) == (with_words["plan"], with_words["names"])


def test_the_tokenizer_gives_every_text_back_and_sees_no_words(data: Path, tmp_path: Path) -> None:
    tokenizer = CanonicalTokenizer.of_data(data, 32, "difference")
    tokenizer.save_pretrained(tmp_path)
    for split in ("train", "unseen_predicates"):
        table = rows(data, split)
        prompts, completions, words = ([row[key] for row in table] for key in ("prompt", "completion", "words"))
        asked, said, legends = CanonicalTokenizer.load(tmp_path).encode_records(prompts, completions, words)
        texts = tokenizer.decode([[*a, *b] for a, b in zip(asked, said, strict=True)], legends)
        assert texts == [f"{prompt} {completion}" for prompt, completion in zip(prompts, completions, strict=True)]
        known = {tokenizer.words[token] for row in [*asked, *said] for token in row}
        assert not known & {"<raw>", "<unknown>", "<whole>"}
        alone, prompt_legends = tokenizer.encode_prompts(prompts)
        assert [row.tolist() for row in alone] == [row.tolist() for row in asked]
        made = tokenizer.decode_completions(alone, [row.tolist() for row in said], prompt_legends)
        # In the report's style the prompt does not say the actions' words.
        typed = [number for number, row in enumerate(table) if row["style"] == "typed"]
        assert [made[number] for number in typed] == [completions[number] for number in typed]


@pytest.mark.parametrize("suite", ["seen", "unseen-predicates"])
def test_states_in_other_words_are_judged_by_what_they_mean(data: Path, suite: str) -> None:
    folder = DataFolder(data)
    items = folder.items(suite)
    problems, words = [folder.problem(item) for item in items], [folder.words(item) for item in items]
    right = _native.judge(folder.domain, problems, [item.completion for item in items], words)
    assert all(found.verdict.is_valid and found.states_right == found.states_total > 0 for found in right)
    wrong = _native.judge(folder.domain, problems, [item.negative for item in items], words)
    assert not any(found.verdict.is_valid and found.states_right == found.states_total for found in wrong)


def test_a_prompt_of_ones_own_may_have_words_for_predicates(data: Path) -> None:
    folder = DataFolder(data)
    task = folder.task(folder.items("seen")[0])
    words = [*folder.actions, "held", "near", "atop", "inside", "uncovered"]
    prompt = _native.render_prompt(task, "typed", words)
    assert ", close close, inhand held, inworkspace near, on atop, in inside, opened uncovered <GOAL>" in prompt
    with pytest.raises(_native.DataError, match="6 words, but the domain has 5 actions and 5 predicates"):
        _native.render_prompt(task, "typed", words[:6])


@pytest.mark.parametrize(
    ("column", "old", "new"), [("words", 7, "inside"), ("prompt", ", on ", ", on x"), ("completion", "(", "x(")]
)
def test_another_word_is_found_by_the_oracle_alone(data: Path, column: str, old: int | str, new: str) -> None:
    table = pq.read_table(data / "data" / "unseen_predicates-00000-of-00001.parquet")
    values = table[column].to_pylist()
    for row in range(0, 20, 3):
        changed = values.copy()
        value = values[row]
        changed[row] = value.replace(old, new, 1) if isinstance(old, str) else [*value[:old], new, *value[old + 1 :]]
        assert changed[row] != value
        place = table.column_names.index(column)
        tampered = table.set_column(place, column, pa.array(changed, table.schema.field(column).type))
        faults = _Checker(data).check("unseen-predicates", 0, tampered, Found(), None)
        assert any(fault.startswith(f"unseen-predicates {row}: ") for fault in faults)


def test_show_makes_a_record_anew(data: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["show", str(data), "7", "--split=unseen-predicates", "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == rows(data, "unseen_predicates")[7]


def test_held_out_words_must_not_be_trained() -> None:
    train, suite = Found(predicate_words={"atop"}), Found(predicate_words={"atop"})
    train.sizes, train.lengths, train.steps = {3}, {2}, {2}
    assert shared({"train": train, "unseen-predicates": suite}) == [
        "unseen-predicates: shares predicate word atop with train"
    ]


def test_words_that_no_lexicon_has_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    asked = ["gen-data", f"--out={tmp_path / 'out'}", "--domain=ferry", *SMALL, "--set=data.predicate_words=0.5"]
    assert main(asked) == 2
    assert "lexicon gives no words for predicates" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
