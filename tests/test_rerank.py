"""Choosing among samples: the likelihood of each step as a first one against a slow twin, and what is worth nothing."""

from __future__ import annotations

import math
import re
import shutil
from dataclasses import replace
from importlib.resources import files
from typing import TYPE_CHECKING

import pytest

torch = pytest.importorskip("torch")
torch.set_num_threads(1)

from transformers import GPT2Config, GPT2LMHeadModel  # noqa: E402

from strips_lm import _native  # noqa: E402
from strips_lm.config import ConfigError, RunConfig  # noqa: E402
from strips_lm.decode import Generation  # noqa: E402
from strips_lm.generate import Completion, Planner  # noqa: E402
from strips_lm.lstm import LstmConfig, LstmLMHeadModel  # noqa: E402
from strips_lm.replan import first_steps  # noqa: E402
from strips_lm.rerank import Drawn, Rating, head_scores, rate, replan_scores  # noqa: E402
from strips_lm.tokenizer import CanonicalTokenizer, TokenizerError  # noqa: E402
from test_generate import PROMPTS, TEXT, checkpoint, planner  # noqa: E402, F401  (a fixture is used by its name)

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

ONE = "<ACTION> pick(cup) <STATE> inhand(cup) <|endoftext|>"
STATELESS = TEXT.replace("<STATE> inhand(cup) ", "")
ATOMS = ", ".join(["on(cup, table)"] * 200)


def drawn(found: Planner, samples: list[tuple[int, str]]) -> Drawn:
    """Texts as if they had been drawn for the prompts of these numbers."""
    ids, _ = found.tokenizer.encode_prompts(PROMPTS)
    made, texts = [], []
    for number, text in samples:
        tokens = found.tokenizer.encode_records([PROMPTS[number]], [text])[1][0].tolist()
        finished = text.endswith("<|endoftext|>")
        made.append(Generation(number, 0, tokens, finished, -1.0))
        texts.append(Completion(text, len(tokens), finished, -1.0, ids=tokens))
    return Drawn(PROMPTS, ids, made, texts, 0.0)


def slow_steps(found: Planner, prompt: str, text: str) -> Iterator[tuple[list[int], list[int]]]:
    """Tokens of each step with those of the prompt that asks for it, cut out of the text in another way."""
    for step in re.findall(r"<ACTION> (?:(?!<ACTION>).)*", text):
        asked, said, _ = found.tokenizer.encode_records([prompt], [step.strip()])
        yield [*map(int, asked[0])], [*map(int, said[0])]
        prompt = re.sub("<INIT> .*", "<INIT> " + step.split("<STATE> ")[1].strip(), prompt)


def slow(found: Planner, prompt: str, text: str) -> float:
    """One step at a time, one token at a time."""
    whole = 0.0
    for ids, said in slow_steps(found, prompt, text):
        for place, token in enumerate(said):
            with torch.no_grad():
                logits = found.model(torch.tensor([ids + said[:place]])).logits[0, -1]
            whole += float(logits.log_softmax(-1)[token])
    return whole


def slow_chance(found: Planner, prompt: str, text: str) -> float:
    """The second head's own logit of each step, by transformers' forward pass."""
    whole = 1.0
    for ids, said in slow_steps(found, prompt, text):
        with torch.no_grad():
            row = torch.tensor([[ids + said]])
            logit = found.model(row, mc_token_ids=torch.tensor([[row.shape[-1] - 1]])).mc_logits
        whole *= float(logit.double().sigmoid())
    return math.log(whole)


@pytest.mark.parametrize("kind", ["double-head", "lm", "lstm"])
def test_a_sample_is_worth_what_its_steps_are_as_first_ones(checkpoint: Path, kind: str) -> None:  # noqa: F811
    found = planner(checkpoint)
    torch.manual_seed(5)
    if kind == "lm":
        found = Planner(GPT2LMHeadModel(found.model.config).eval(), found.tokenizer, found.config)
    elif kind == "lstm":
        sizes = LstmConfig(vocab_size=found.tokenizer.vocab_size, embedding_size=16, hidden_size=24)
        found = Planner(LstmLMHeadModel(sizes).eval(), found.tokenizer, found.config)
    samples = [(0, TEXT), (1, TEXT), (0, ONE), (1, ONE), (0, TEXT)]
    scores = replan_scores(found, drawn(found, samples))
    assert scores == pytest.approx([slow(found, PROMPTS[number], text) for number, text in samples], rel=1e-3)
    assert len(set(scores)) == 4
    assert found.complete(PROMPTS, "best-of-k").completions, "with a second head or without"


def test_a_head_that_judges_steps_is_asked_for_each(checkpoint: Path) -> None:  # noqa: F811
    found = planner(checkpoint)
    found.model.multiple_choice_head.summary.weight.data *= 50
    samples = [(0, TEXT), (1, TEXT), (0, ONE), (0, TEXT.removesuffix(" <|endoftext|>")), (0, STATELESS)]
    texts = drawn(found, samples)
    whole = head_scores(found, texts)
    found.model.config.judges_steps = True
    scores = head_scores(found, texts)
    assert scores[:3] == pytest.approx([slow_chance(found, PROMPTS[n], text) for n, text in samples[:3]], rel=1e-3)
    assert scores[3:] == [-math.inf] * 2
    assert scores != whole
    assert rate(found, texts, "auto").scores == scores
    found.model.config.judges_steps = False
    assert rate(found, texts, "auto").scores == replan_scores(found, texts)
    assert len(set(scores[:3])) == 3


def test_another_checkpoint_may_judge(checkpoint: Path, tmp_path: Path) -> None:  # noqa: F811
    with pytest.raises(ConfigError, match="judges no steps"):
        planner(checkpoint, f"generate.judge={checkpoint}")
    other = planner(checkpoint)
    other.model.config.judges_steps = True
    other.model.transformer.ln_f.weight.data *= 30
    shutil.copytree(checkpoint, tmp_path / "judge")
    other.model.save_pretrained(tmp_path / "judge")
    found = planner(checkpoint, f"generate.judge={tmp_path / 'judge'}", "generate.attempts=2")
    texts = drawn(found, [(0, TEXT), (1, TEXT), (0, ONE)])
    assert rate(found, texts, "auto").scores == rate(found, texts, "head").scores == head_scores(other, texts)
    assert replan_scores(found, texts) == replan_scores(planner(checkpoint), texts)
    assert len(found.complete(PROMPTS, "replan").completions) == 2
    domain = _native.Domain.parse((files("strips_lm") / "domains" / "manipulation" / "domain.pddl").read_bytes())
    assert found.for_domain(domain).judging.judges_steps


def test_steps_are_asked_for_from_the_state_before_them() -> None:
    pick, place = (f"<ACTION> {step}" for step in TEXT.split("<ACTION> ")[1:])
    asked = PROMPTS[0].replace("<INIT> on(cup, table)", "<INIT> inhand(cup)")
    assert first_steps(PROMPTS[0], TEXT) == [(PROMPTS[0], pick.strip()), (asked, place)]
    assert first_steps(PROMPTS[0], "<|endoftext|>") == [(PROMPTS[0], "<|endoftext|>")], "nothing to do"
    assert first_steps(PROMPTS[0], STATELESS) == first_steps(PROMPTS[0], f"on(cup) {TEXT}") == []


def test_what_cannot_be_asked_anew_is_worth_nothing(checkpoint: Path) -> None:  # noqa: F811
    found = planner(checkpoint)
    long = TEXT.replace("<STATE> inhand(cup)", f"<STATE> {ATOMS}")
    unfinished = TEXT.removesuffix(" <|endoftext|>")
    scores = replan_scores(found, drawn(found, [(0, STATELESS), (0, long), (0, unfinished), (0, "cup"), (0, TEXT)]))
    assert scores[:4] == [-math.inf] * 4
    assert math.isfinite(scores[4])


def test_the_best_is_finished_then_highest_then_likeliest(checkpoint: Path) -> None:  # noqa: F811
    texts = [(0, "cup"), (0, ONE), (0, TEXT), (1, "cup"), (1, "cup")]
    found = drawn(planner(checkpoint), texts)
    assert Rating([9.0, 1.0, 2.0, 1.0, 3.0], 0.0).best(found) == [2, 4]
    found.made[1] = replace(found.made[1], log_probability=-0.5)
    assert Rating([9.0, 2.0, 2.0, 1.0, 1.0], 0.0).best(found) == [1, 3], "the first where all is equal"


def test_states_with_more_objects_than_slots_lose_nothing_else() -> None:
    domain = _native.Domain.parse((files("strips_lm") / "domains" / "manipulation" / "domain.pddl").read_bytes())
    words = CanonicalTokenizer(_native.CanonicalCodec(domain), 4)
    sizes = {"n_positions": 256, "n_embd": 32, "n_layer": 1, "n_head": 2, "vocab_size": words.vocab_size}
    ends = {"bos_token_id": words.start_id, "eos_token_id": words.end_id}
    found = Planner(
        GPT2LMHeadModel(GPT2Config(**sizes, **ends)).eval(),
        words,
        RunConfig.load(None, ["generate.max_new=20", "generate.workers=1"]).generate,
    )
    crowd = ", ".join(f"on(thing_{number}, shelf)" for number in range(9))
    right, wrong = drawn(found, [(0, TEXT)]), TEXT.replace("<STATE> inhand(cup)", f"<STATE> {crowd}")
    samples = Drawn(PROMPTS, right.ids, right.made * 2, [replace(right.texts[0], text=wrong), *right.texts], 0.0)
    assert replan_scores(found, samples) == [-math.inf, replan_scores(found, right)[0]]
    crowded = f"{PROMPTS[0]}, {crowd}"
    (lost,), (kept,) = found.first_steps([crowded, PROMPTS[0]], 1)
    assert (lost.text, lost.finished) == ("", False)
    assert kept == found.first_steps(PROMPTS[:1], 1)[0][0]
    with pytest.raises(TokenizerError, match="objects"):
        found.complete([crowded], "replan")


def test_plans_that_the_head_doubts_are_tried_again(checkpoint: Path, monkeypatch: pytest.MonkeyPatch) -> None:  # noqa: F811
    found = planner(checkpoint, "generate.attempts=4")
    with pytest.raises(ConfigError, match="judges steps"):
        found.complete(PROMPTS, "replan")
    found.model.config.judges_steps = True
    tried: list[dict[str, Completion]] = []
    chances = iter([[-0.1, -3.0], [-2.0], [-2.5], [-1.0]])

    def holds(_: Planner, prompts: Sequence[str], plans: Sequence[Completion]) -> list[float]:
        tried.append(dict(zip(prompts, plans, strict=True)))
        return next(chances)

    monkeypatch.setattr("strips_lm.generate.plan_log_chances", holds)
    made = found.complete(PROMPTS, "replan")
    assert [list(plans) for plans in tried] == [PROMPTS, *[PROMPTS[1:]] * 3], "the first is approved at once"
    assert made.completions == [tried[0][PROMPTS[0]], tried[3][PROMPTS[1]]]
    assert made.tokens == sum(plan.tokens for plans in tried for plan in plans.values())
    assert len({plans[PROMPTS[1]].text for plans in tried}) == 4
    monkeypatch.undo()
    once, again = (found.complete(PROMPTS, "replan") for _ in range(2))
    assert once.completions == again.completions
