"""Search with a budget, and the oracle's own search where it is spent."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import pytest

torch = pytest.importorskip("torch")
torch.set_num_threads(1)

from strips_lm import _native  # noqa: E402
from strips_lm.cli import main  # noqa: E402
from strips_lm.fallback import shortest  # noqa: E402
from strips_lm.generate import GUIDED  # noqa: E402
from test_masked import MANIPULATION, PROBLEM, Questions, checkpoint, planner, questions  # noqa: E402, F401

if TYPE_CHECKING:
    from pathlib import Path

ONE_CALL = ("generate.search_calls=1", "generate.max_new=12")


@pytest.mark.parametrize("decode", GUIDED)
def test_where_the_model_comes_to_no_plan_the_oracle_answers(questions: Questions, decode: str) -> None:  # noqa: F811
    alone = planner(1, *ONE_CALL).complete(questions.prompts, decode, tasks=questions.oracle())
    helped = planner(1, *ONE_CALL, "generate.fallback=true").complete(
        questions.prompts, decode, tasks=questions.oracle()
    )
    assert any(not c.finished for c in alone.completions)
    judged = zip(questions.tasks, alone.completions, helped.completions, questions.judge(helped), strict=True)
    for task, before, after, judgement in judged:
        best = task.plan_set(12).shortest()
        assert after.by_oracle == (not before.finished and best is not None)
        assert after.finished == judgement.verdict.is_valid == (best is not None)
        if after.by_oracle and best is not None:
            assert (judgement.steps, judgement.states_right) == (len(best), len(best))
        else:
            assert after.text == before.text


def test_shorter_plans_are_sought_until_they_are_shortest(questions: Questions) -> None:  # noqa: F811
    calls = "generate.search_calls=3000"
    first = planner(6, calls).complete(questions.prompts, "search", tasks=questions.oracle())
    best = planner(6, calls, "generate.search_shorter=true").complete(
        questions.prompts, "search", tasks=questions.oracle()
    )
    lengths = [(a.steps, b.steps) for a, b in zip(questions.judge(first), questions.judge(best), strict=True)]
    plans = [task.plan_set(8).shortest() for task in questions.tasks]
    assert all(b == len(plan) for (_, b), plan in zip(lengths, plans, strict=True) if plan is not None)
    assert any(a > b for a, b in lengths)


def test_a_budget_of_time_ends_a_search(questions: Questions) -> None:  # noqa: F811
    made = planner(1, "generate.search_seconds=1e-9").complete(questions.prompts, "search", tasks=questions.oracle())
    assert all(c.choices <= 1 for c in made.completions)


def test_the_oracle_gives_up_where_there_is_no_plan_or_no_time() -> None:
    domain = _native.Domain.parse((MANIPULATION / "domain.pddl").read_bytes())
    problem = PROBLEM.format(number=0, extra="", more="", goal="(on samovar samovar)")
    task = _native.Task(domain, _native.Problem.parse(problem, domain))
    assert shortest(task, 10.0) is None


def test_generate_says_who_answered(
    checkpoint: Path,  # noqa: F811
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    problem = tmp_path / "kitchen.pddl"
    problem.write_text(PROBLEM.format(number=0, extra="", more="", goal="(on samovar shelf_0)"))
    command = ["generate", str(checkpoint), str(MANIPULATION / "domain.pddl"), str(problem), "--fallback"]
    keys = [f"--set={key}" for key in ONE_CALL]
    assert main([*command, "--decode", "search", *keys]) == 0
    assert "the oracle's own search answers" in capsys.readouterr().out
    assert main([*command, "--decode", "search", *keys, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["by_oracle"]
    assert found["valid"]
    assert main(command) == 2, "greedy decoding has no budget to spend"
