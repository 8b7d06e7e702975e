"""What an evaluation counts, and how it is kept."""

from __future__ import annotations

import json
from collections import Counter
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fixture_results import made_up_results
from strips_lm.config import ConfigError, RunConfig
from strips_lm.evaluate.results import Results, differences
from strips_lm.evaluate.statistics import effective, wilson
from strips_lm.evaluate.tally import Trial, own_choices, tally


@dataclass(frozen=True)
class FakeVerdict:
    outcome: str
    step: int | None

    @property
    def is_valid(self) -> bool:
        return self.outcome == "valid"


@dataclass(frozen=True)
class FakeJudgement:
    verdict: FakeVerdict
    steps: int = 3
    executable_steps: int = 3
    states_total: int = 3
    states_right: int = 3


def judgement(outcome: str, step: int | None = None, **rest: Any) -> Any:
    return FakeJudgement(FakeVerdict(outcome, step), **rest)


def trial(finished: list[bool], optimal: list[int]) -> Trial:
    return Trial(
        model="m",
        suite="s",
        decode="greedy",
        oracle_helps=False,
        texts=["x"] * len(finished),
        finished=finished,
        optimal_steps=optimal,
        tokens=100,
        seconds=2.0,
        verify_seconds=0.0,
    )


def test_wilson_is_the_published_interval() -> None:
    # Newcombe 1998, table I: 81 of 263 by the score method
    low, high = wilson(81, 263)
    assert (round(low, 4), round(high, 4)) == (0.2553, 0.3662)


@given(st.integers(0, 500), st.integers(0, 500), st.none() | st.floats(1.0, 1000.0))
def test_the_interval_holds_the_share(successes: int, failures: int, worth: float | None) -> None:
    low, high = wilson(successes, successes + failures, worth)
    assert 0.0 <= low <= high <= 1.0
    if successes + failures:
        assert low <= successes / (successes + failures) <= high


@given(st.lists(st.integers(0, 6), min_size=1, max_size=60))
def test_prompts_of_one_problem_count_less_than_as_many_problems(problems: list[int]) -> None:
    worth, different = effective(problems), len(set(problems))
    assert 1.0 <= worth <= different + 1e-9
    assert worth == pytest.approx(different) or len(set(Counter(problems).values())) > 1
    assert effective(problems * 3) == pytest.approx(worth), "asked three times as often, worth the same"


def test_the_interval_is_that_of_the_problems() -> None:
    judgements = [judgement("valid")] * 30 + [judgement("inapplicable", 1)] * 10
    each_once = trial([True] * 40, [3] * 40)
    four_times = replace(each_once, problems=[number // 4 for number in range(40)])
    narrow, wide = tally(each_once, judgements), tally(four_times, judgements)
    assert (narrow.problems, narrow.effective, wide.problems, wide.effective) == (40, 40.0, 10, 10.0)
    assert (narrow.valid_low, narrow.valid_high) == wilson(30, 40)
    assert (wide.valid_low, wide.valid_high) == wilson(30, 40, 10.0)
    # 2 of 4 four times over is as sure as 2 of 4, and no surer
    assert wilson(8, 16, 4.0) == pytest.approx(wilson(2, 4))
    assert wide.share == narrow.share
    assert (wide.repeats, narrow.repeats) == (True, False)


def test_a_file_from_before_problems_were_counted_is_compared_in_all_else() -> None:
    now = tally(trial([True, True], [3, 3]), [judgement("valid"), judgement("valid")])
    before = replace(now, problems=None, effective=None, valid_low=0.1)
    results = [Results(data="d", config={}, scores=[score]) for score in (before, now, replace(now, valid=1))]
    assert differences(results[0], results[1]) == []
    assert len(differences(results[0], results[2])) == 1
    assert len(differences(results[1], results[2])) == 1


def test_what_is_counted() -> None:
    judgements = [
        judgement("valid"),
        judgement("valid", states_right=2),
        judgement("inapplicable", 2, executable_steps=1),
        judgement("syntax", None, steps=0, executable_steps=0, states_total=0, states_right=0),
        judgement("valid"),
    ]
    tried = trial([True, True, True, True, False], [3, 2, 3, 5, 3])
    score = tally(replace(tried, templates=["tea", "random", "tea", "tea", "random"]), judgements)
    assert (score.prompts, score.valid, score.optimal, score.surplus_mean) == (5, 2, 1, 0.5)
    assert (score.unfinished, score.malformed, score.traces_right) == (1, 1, 1)
    assert score.verdicts == {"valid": 2, "inapplicable": 1, "syntax": 1, "unfinished": 1}
    assert score.failed_at == {"2": 1, "-": 2}
    assert score.by_length == {"2": [1, 1], "3": [1, 3], "5": [0, 1]}
    assert score.by_template == {"random": [1, 2], "tea": [1, 3]}
    assert tally(tried, judgements).by_template == {}
    assert (score.states, score.states_right, score.tokens_per_second) == (12, 11, 50.0)


def test_a_valid_plan_without_an_end_is_not_valid() -> None:
    assert tally(trial([False], [3]), [judgement("valid")]).valid == 0


def test_own_samples_are_compared_within_their_prompt() -> None:
    prompts, right = [0, 0, 0, 1, 1, 2], [True, False, False, True, True, False]
    assert own_choices(prompts, right, [0.5, 0.1, 0.9, 0.0, 0.0, 7.0]) == [1, 2]
    assert own_choices(prompts, right, [0.5, 0.5, 0.4, 0.0, 0.0, 7.0]) == [1, 2], "equal is not higher"


def test_results_come_back_as_they_were_saved(tmp_path: Path) -> None:
    results = made_up_results(tmp_path)
    results.save(tmp_path / "results.json")
    assert Results.load(tmp_path / "results.json") == results
    saved = json.loads((tmp_path / "results.json").read_text(encoding="utf-8"))
    saved["models"] = [{**model, "seconds_trained": None, "steps_trained": None} for model in saved["models"]]
    (tmp_path / "before.json").write_text(json.dumps(saved), encoding="utf-8")
    assert Results.load(tmp_path / "before.json") == results, "fields of before that were always empty"


def test_reproducing_looks_past_timings_and_at_the_rest(tmp_path: Path) -> None:
    old, new = made_up_results(tmp_path / "a"), made_up_results(tmp_path / "b")
    new.scores[0] = replace(new.scores[0], seconds=99.0, prompts_per_second=1.0)
    assert differences(old, new) == []
    new.scores[0] = replace(new.scores[0], valid=195, digest="1" * 64)
    assert len(differences(old, new)) == 2
    del new.scores[1]
    assert any("missing" in line for line in differences(old, new))


def test_another_file_is_refused_with_a_sentence(tmp_path: Path) -> None:
    (tmp_path / "results.json").write_text('{"format": "something else"}')
    with pytest.raises(ConfigError, match="not a results file"):
        Results.load(tmp_path / "results.json")


def test_settings_of_results_give_the_configuration_back(tmp_path: Path) -> None:
    from dataclasses import asdict

    from strips_lm.cli.evaluate import settings

    config = RunConfig.load(None, ["seed=4", "generate.top_k=7", 'evaluate.suites=["seen"]'])
    results = made_up_results(tmp_path)
    results.config = {"seed": 4, "generate": asdict(config.generate), "evaluate": asdict(config.evaluate)}
    assert RunConfig.load(None, settings(results)) == config


def test_a_card_carries_the_scores_of_the_last_evaluation_alone(tmp_path: Path) -> None:
    from huggingface_hub import ModelCard

    from strips_lm.checkpoint import Progress, model_card
    from strips_lm.evaluate.card import write_cards

    results = made_up_results(tmp_path)
    for model in results.models:
        folder = Path(model.path)
        (folder / "config.json").write_text("{}")
        (folder / "README.md").write_text(model_card(RunConfig.load("tiny"), Progress(), {}))
    write_cards(results)
    path = Path(results.models[0].path) / "README.md"
    once = path.read_text(encoding="utf-8")
    write_cards(results)
    assert path.read_text(encoding="utf-8") == once
    name = results.models[0].name
    free = [score for score in results.scores if score.model == name and not score.oracle_helps]
    read = ModelCard(once).data.eval_results
    assert [(r.metric_type, r.metric_value) for r in read] == [("valid-plans", round(100 * s.share, 1)) for s in free]
    assert all(r.dataset_name.endswith(f": {s.suite}") for r, s in zip(read, free, strict=True))
    assert once.count("## Results") == once.count("## Limits") == once.count("A plan that it writes may be wrong") == 1
    results.scores = [score for score in results.scores if score.model != name]
    write_cards(results)
    assert "valid-plans" not in path.read_text(encoding="utf-8")
