"""The oracle's mask inside transformers' own `generate`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest

torch = pytest.importorskip("torch")
torch.set_num_threads(1)

from strips_lm import _native  # noqa: E402
from strips_lm.guide import OracleGuide  # noqa: E402
from strips_lm.logits_processor import OracleLogitsProcessor  # noqa: E402
from test_masked import Questions, planner, questions  # noqa: E402, F401

if TYPE_CHECKING:
    from strips_lm.generate import Planner


def written(found: Planner, questions: Questions, **options: Any) -> list[str]:  # noqa: F811
    """The completions that `generate` writes under the mask, the end token included where it came."""
    ids, legends = found.tokenizer.encode_prompts(questions.prompts)
    longest, end = max(map(len, ids)), found.tokenizer.end_id
    padded = torch.tensor([[end] * (longest - len(row)) + row.tolist() for row in ids])
    mask = torch.tensor([[0] * (longest - len(row)) + [1] * len(row) for row in ids])
    processor = OracleLogitsProcessor(OracleGuide(found.tokenizer, legends, questions.oracle()))
    rows = found.model.generate(
        padded,
        attention_mask=mask,
        logits_processor=[processor],
        pad_token_id=end,
        max_new_tokens=160,
        **options,
    )
    texts = [row[: row.index(end) + 1] if end in row else row for row in rows[:, longest:].tolist()]
    each = len(texts) // len(ids)
    many = [i for i in range(len(ids)) for _ in range(each)]
    return found.tokenizer.decode_completions([ids[i] for i in many], texts, [legends[i] for i in many])


@pytest.mark.parametrize("seed", range(2))
def test_greedy_under_the_processor_is_masked_decoding(questions: Questions, seed: int) -> None:  # noqa: F811
    found = planner(seed, "generate.backtrack=false", "generate.renew_steps=0", "generate.shorten=false")
    ours = found.complete(questions.prompts, "masked", tasks=questions.oracle()).completions
    theirs = written(found, questions, do_sample=False)
    finished = [(c.text, text) for c, text in zip(ours, theirs, strict=True) if c.finished and c.tokens <= 160]
    assert finished
    assert all(mine == other for mine, other in finished)
    assert all(c.finished or not text.endswith("<|endoftext|>") for c, text in zip(ours, theirs, strict=True))


@pytest.mark.parametrize(
    "options",
    [{"do_sample": True, "num_return_sequences": 3}, {"num_beams": 3, "num_return_sequences": 3, "do_sample": False}],
)
def test_every_text_that_ends_is_valid(questions: Questions, options: dict[str, Any]) -> None:  # noqa: F811
    torch.manual_seed(4)
    texts = written(planner(1), questions, **options)
    many = [problem.to_pddl() for problem in questions.problems for _ in range(3)]
    words = [{name: name for name in questions.actions}] * len(texts)
    judged = _native.judge(questions.domain, many, texts, words)
    assert any(j.finished for j in judged)
    assert all(j.verdict.is_valid for j in judged if j.finished)
