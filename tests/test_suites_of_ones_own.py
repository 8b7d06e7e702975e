"""Renamed problems, folders of PDDL problems, and what choosing among samples is worth."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import pytest

pytest.importorskip("torch").set_num_threads(1)

from fixture_results import score  # noqa: E402
from strips_lm import _native  # noqa: E402
from strips_lm.cli import main  # noqa: E402
from strips_lm.evaluate.renaming import draw, operators, rename  # noqa: E402
from strips_lm.evaluate.results import Results  # noqa: E402
from strips_lm.evaluate.statistics import rerank_gaps  # noqa: E402
from test_masked import KEYS, MANIPULATION, PROBLEM, checkpoint  # noqa: E402, F401

if TYPE_CHECKING:
    from pathlib import Path

NEW = {"shelf_0": "pick", "samovar": "movable", "tea": "on"}


def test_a_renamed_prompt_is_the_prompt_of_the_renamed_problem() -> None:
    domain = _native.Domain.parse((MANIPULATION / "domain.pddl").read_bytes())
    extra, more = "tea - movable", "(inworkspace tea) (on tea table)"
    text = PROBLEM.format(number=0, extra=extra, more=more, goal="(on samovar shelf_0)")
    problem = _native.Problem.parse(text, domain)
    other = problem.rename([NEW.get(name, name) for name, _ in problem.objects])
    words = [name for name, _ in domain.actions]
    for style in ("typed", "paper"):
        before, after = (
            _native.render_prompt(_native.Task(domain, p), style, words if style == "typed" else None)
            for p in (problem, other)
        )
        assert rename(before, NEW) == after
        assert rename(after, {new: old for old, new in NEW.items()}) == before


def test_names_drawn_are_different_and_the_same_for_the_same_seed() -> None:
    names = draw(["a", "b", "c"], 5, "1")
    assert len(set(names)) == 5
    assert names == draw(["a", "b", "c"], 5, "1")
    assert any(names != draw(["a", "b", "c"], 5, str(seed)) for seed in range(2, 5))


def test_plans_are_compared_by_operators_with_names_given_back() -> None:
    text = "<ACTION> pick(cup) <STATE> inhand(cup) <ACTION> place(cup, shelf) <STATE> on(cup, shelf) <|endoftext|>"
    assert operators(text, {"cup": "x"}) == (("pick", "x"), ("place", "x", "shelf"))


def test_each_choice_closes_a_share_of_the_distance_to_the_oracle() -> None:
    shares = {"first": 100, "head": 130, "likelihood": 90, "replan": 160, "oracle": 160}
    samples = [score("m", "seen", valid, f"best-of-8 by {choice}") for choice, valid in shares.items()]
    closed = {gap.choice: gap.closed for gap in rerank_gaps(samples)}
    wanted = {"best-of-8 by head": 0.5, "best-of-8 by likelihood": -1 / 6, "best-of-8 by replan": 1.0}
    assert closed == pytest.approx(wanted)
    greedy = score("m", "seen", 120)
    assert rerank_gaps([greedy, *samples])[0].closed == pytest.approx(0.25)
    level = [replace(s, valid=100) for s in samples]
    assert rerank_gaps(level)[0].closed is None


def test_evaluate_scores_a_folder_of_problems_and_their_renamings(
    checkpoint: Path,  # noqa: F811
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    small = ["--pairs=60", "--seed=7", "--set=data.suite_records=12", "--set=data.random_problems=20"]
    few = ["--set=data.problems_per_template=4", "--set=data.states_per_start=100", "--jobs=1"]
    assert main(["gen-data", f"--out={tmp_path / 'data'}", *small, *few]) == 0
    own = tmp_path / "kitchens"
    own.mkdir()
    (own / "domain.pddl").write_bytes((MANIPULATION / "domain.pddl").read_bytes())
    for number in range(3):
        goal = f"(on samovar shelf_{number})"
        (own / f"{number}.pddl").write_text(PROBLEM.format(number=number, extra="", more="", goal=goal))
    keys = [f"--set={key}" for key in (*KEYS, "evaluate.renamed_problems=2", "evaluate.renamings=3")]
    found = tmp_path / "results.json"
    ways = ["--decode=greedy", "--decode=masked", "--decode=best-of-k", "--set=generate.samples=2"]
    command = ["evaluate", str(checkpoint), f"--data={tmp_path / 'data'}", f"--problems={own}", f"--json={found}"]
    assert main([*command, *ways, *keys, "--set=generate.max_new=60"]) == 0
    results = Results.load(found)
    assert {(s.suite, s.prompts) for s in results.scores} == {("kitchens", 3)}
    assert [s.decode for s in results.scores][:3] == ["greedy", "masked", "best-of-2 by first"]
    assert results.likelihoods == []
    (same,) = results.invariances
    assert (same.problems, same.renamed, same.same, same.always) == (2, 6, 6, 2), "canonical words have no names"
    assert "The same problems under other names" in capsys.readouterr().out
    assert main(["evaluate", "--reproduce", str(found)]) == 0
