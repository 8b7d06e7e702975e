"""What `--explain` says is the model's own probabilities, the mask's own flags and the oracle's own verdict."""

from __future__ import annotations

import json
import math
from typing import TYPE_CHECKING

import pytest

torch = pytest.importorskip("torch")
torch.set_num_threads(1)

from strips_lm.cli import main  # noqa: E402
from strips_lm.explain import explain  # noqa: E402
from strips_lm.generate import Completion  # noqa: E402
from test_masked import MANIPULATION, PROBLEM, Questions, checkpoint, planner, questions  # noqa: E402, F401

if TYPE_CHECKING:
    from pathlib import Path


@pytest.fixture
def question() -> Questions:
    goal = "(on samovar shelf_0)"
    problem = PROBLEM.format(number=0, extra="tea - movable", more="(inworkspace tea) (on tea table)", goal=goal)
    return Questions(MANIPULATION / "domain.pddl", [problem])


def completion(question: Questions, text: str) -> Completion:
    """A text of anybody's as the model's own."""
    _, (ids,), _ = planner().tokenizer.encode_records(question.prompts, [text])
    return Completion(text, len(ids), finished=True, log_probability=0.0, ids=ids.tolist())


def test_what_the_mask_wrote_is_allowed_everywhere_and_its_removed_shares_add_up(question: Questions) -> None:
    found = planner(2, "generate.shorten=false")
    made = found.complete(question.prompts, "masked", tasks=question.oracle()).completions[0]
    steps = explain(found, question.prompts[0], made, question.oracle())
    positions = [position for step in steps for position in step.positions]
    assert all(position.allowed for position in positions)
    assert all(step.state_written == step.state_true for step in steps)
    chosen = [p for p in positions if sum(bool(c.allowed) for c in p.choices) > 1]
    assert len(chosen) == made.choices
    assert sum(p.removed or 0.0 for p in chosen) == pytest.approx(made.removed, rel=1e-4)


def test_probabilities_multiply_to_the_texts(question: Questions) -> None:
    found = planner(3, "generate.max_new=12")
    made = found.complete(question.prompts, "greedy").completions[0]
    steps = explain(found, question.prompts[0], made)
    (ids,), _ = found.tokenizer.encode_prompts(question.prompts)
    text = torch.tensor([[*map(int, ids), *made.ids]])
    with torch.no_grad():
        log_probs = found.model(text).logits[0].log_softmax(-1)[len(ids) - 1 : -1]
    wanted = float(log_probs.gather(-1, torch.tensor(made.ids)[:, None]).sum())
    said = sum(math.log(s.probability) + math.log(s.state_probability or 1.0) for s in steps)
    assert said == pytest.approx(wanted, rel=1e-4)
    assert all(p.allowed is None and p.removed is None for s in steps for p in s.positions)


def test_a_step_that_cannot_be_executed_is_where_the_mask_stops(question: Questions) -> None:
    state = "inhand(samovar), inworkspace(table), inworkspace(shelf_0), inworkspace(samovar), inworkspace(tea)"
    state += ", on(tea, table)"
    text = f"<ACTION> pick(samovar) <STATE> {state} <ACTION> pick(tea) <STATE> {state} <|endoftext|>"
    steps = explain(planner(), question.prompts[0], completion(question, text), question.oracle())
    assert [p.allowed for p in steps[0].positions] == [True, True, True]
    assert steps[0].state_written == steps[0].state_true == "+inhand samovar -on samovar table"
    assert [p.allowed for p in steps[1].positions] == [True, False, None]
    assert steps[1].state_true is None


def test_a_wrong_state_is_told_from_the_true_one(question: Questions) -> None:
    state = "inhand(samovar), inworkspace(table), inworkspace(shelf_0), inworkspace(samovar), inworkspace(tea)"
    text = f"<ACTION> pick(samovar) <STATE> {state} <|endoftext|>"
    step = explain(planner(), question.prompts[0], completion(question, text), question.oracle())[0]
    assert step.state_true == "+inhand samovar -on samovar table"
    assert step.state_written == "+inhand samovar -on samovar table -on tea table"


def test_generate_explains_in_text_and_json(
    checkpoint: Path,  # noqa: F811
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    problem = tmp_path / "kitchen.pddl"
    problem.write_text(PROBLEM.format(number=0, extra="", more="", goal="(on samovar shelf_0)"))
    command = ["generate", str(checkpoint), str(MANIPULATION / "domain.pddl"), str(problem), "--explain"]
    assert main([*command, "--decode", "masked"]) == 0
    out = capsys.readouterr().out
    plan = [line for line in out.splitlines() if not line.startswith(";")]
    assert f"; step 1, <ACTION> {plan[0].strip('()')}: probability" in out
    assert "(not allowed)" in out
    assert all(line.startswith("(") for line in plan), "what is not a step is a comment"
    assert main([*command, "--json", "--set=generate.max_new=30"]) == 1
    found = json.loads(capsys.readouterr().out)
    assert found["steps"][0]["positions"][0]["choices"]
    assert found["reason"] in [
        line.removeprefix(f"{found['verdict']}: ") for s in found["steps"] for line in s["wrong"]
    ]
