"""Under the mask steps are taken back where nothing may come, and detours are cut out: a plan wherever there is one."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest

torch = pytest.importorskip("torch")

from strips_lm import _native  # noqa: E402
from strips_lm.config import RunConfig  # noqa: E402
from strips_lm.generate import Planner  # noqa: E402
from strips_lm.guides import oracle_guide  # noqa: E402
from strips_lm.replan import Encoded, Renewal  # noqa: E402
from strips_lm.tokenizer import CanonicalTokenizer  # noqa: E402
from test_masked import (  # noqa: E402
    AS_WRITTEN,
    KEYS,
    Questions,
    planner,
    questions,  # noqa: F401
    tokenizer,
    untrained,
    untrained_lstm,
    without_objects,
)

if TYPE_CHECKING:
    from strips_lm.guide import Tasks


def slow_backtracking(found: Planner, asked: Encoded, oracle: Tasks, number: int, every: int) -> tuple[Any, ...]:
    """Masked decoding in which the model reads its whole row anew at every choice: tokens, choices, ways taken back."""
    guide = oracle_guide(found.tokenizer, asked.legends, oracle)
    renewal = Renewal(found.tokenizer, asked) if asked.lists_objects() else None
    (row,), (text,) = guide.add([number])
    prompt, told, choices, back = [*map(int, asked.ids[number])], 0, 0, 0
    while not guide.has_ended(row):
        is_open = guide.is_open([row])[0]
        if is_open:
            with torch.no_grad():
                logits = found.model(torch.tensor([prompt + text[told:]])).logits[0, -1]
            token = int(logits.masked_fill(~torch.from_numpy(guide.mask([row])[0]), -torch.inf).argmax())
            text = [*text, token, *guide.advance([row], [token])[0]]
            choices += 1
        else:
            taken = guide.backtrack(row)
            if taken is None:
                break
            begins = [i for i, said in enumerate(text) if said == guide.step]
            text = [*text[: begins[taken[0]]], *taken[1]]
            back += 1
        if renewal and (text[told:].count(guide.step) > every or not is_open):
            told = max(i for i, said in enumerate(text) if said == guide.step or i == 0)
            prompt = renewal([(number, text[:told])])[0] if told else [*map(int, asked.ids[number])]
    return text, choices, back


@pytest.mark.parametrize(
    ("decode", "bare", "lstm"),
    [("masked", False, False), ("masked", True, False), ("masked", True, True), ("masked-replan", False, False)],
)
def test_steps_are_taken_back_as_in_the_slow_twin(questions: Questions, decode: str, bare: bool, lstm: bool) -> None:  # noqa: F811
    prompts = [without_objects(prompt) if bare else prompt for prompt in questions.prompts]
    backs = 0
    config = RunConfig.load(
        None, [*KEYS, *AS_WRITTEN, "generate.max_new=4000", "generate.rows=5", "generate.renew_steps=3"]
    ).generate
    for seed in range(8):
        found = Planner(untrained_lstm(seed) if lstm else untrained(seed), tokenizer(), config)
        asked = Encoded(prompts, *found.tokenizer.encode_prompts(prompts))
        made = found._guided(asked, decode, questions.oracle())
        for number, generation in enumerate(made):
            every = 1 if decode == "masked-replan" else 3
            text, choices, back = slow_backtracking(found, asked, questions.oracle(), number, every)
            assert (list(generation.tokens), generation.choices) == (text, choices)
            backs += back
    assert backs > 5


@pytest.mark.parametrize("decode", ["masked", "masked-replan"])
@pytest.mark.parametrize("layout", ["difference", "progress", "report"])
def test_with_room_enough_every_problem_is_solved_whatever_the_model(
    questions: Questions,  # noqa: F811
    layout: Any,
    decode: str,
) -> None:
    words = CanonicalTokenizer(_native.CanonicalCodec(questions.domain, layout=layout), 16)
    config = RunConfig.load(None, [*KEYS, "generate.max_new=20000"]).generate
    solvable = [task.shortest_plan() is not None for task in questions.tasks]
    assert any(solvable)
    for model in (untrained(6, 512, words), untrained_lstm() if layout == "difference" else untrained(7, 512, words)):
        made = Planner(model, words, config).complete(questions.prompts, decode, tasks=questions.oracle())
        assert [completion.finished for completion in made.completions] == solvable
        assert [judgement.verdict.is_valid for judgement in questions.judge(made)] == solvable


@pytest.mark.parametrize("decode", ["masked", "masked-replan"])
def test_plans_are_shortened_after_the_model_has_made_its_choices(questions: Questions, decode: str) -> None:  # noqa: F811
    shorter = 0
    for seed in range(4):
        written = planner(seed, *AS_WRITTEN).complete(questions.prompts, decode, tasks=questions.oracle())
        short = planner(seed).complete(questions.prompts, decode, tasks=questions.oracle())
        judged = zip(
            written.completions, short.completions, questions.judge(written), questions.judge(short), strict=True
        )
        for text, other, before, after in judged:
            assert (text.choices, text.finished) == (other.choices, other.finished)
            assert after.verdict.is_valid == before.verdict.is_valid
            assert after.states_right == after.states_total == after.steps
            assert after.steps < before.steps or other.text == text.text
            shorter += after.steps < before.steps
    assert shorter > 5
