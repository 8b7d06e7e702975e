"""A checkpoint at work: ways of decoding, and the command that never calls a plan valid that the oracle has not."""

from __future__ import annotations

import json
import math
from importlib.resources import files
from pathlib import Path
from typing import Any

import pytest

torch = pytest.importorskip("torch")
torch.set_num_threads(1)

from transformers import GPT2Config, GPT2DoubleHeadsModel  # noqa: E402

from strips_lm.cli import main  # noqa: E402
from strips_lm.config import ConfigError, RunConfig  # noqa: E402
from strips_lm.generate import Planner  # noqa: E402
from strips_lm.rerank import head_scores, rate  # noqa: E402
from strips_lm.tokenizer import BpeTokenizer  # noqa: E402

PROMPTS = [
    "<|startoftext|> <GOAL> on(cup, shelf) <INIT> on(cup, table)",
    "<|startoftext|> <GOAL> in(tea, box), opened(box) <INIT> on(tea, table), on(box, table)",
]
TEXT = "<ACTION> pick(cup) <STATE> inhand(cup) <ACTION> place(cup, shelf) <STATE> on(cup, shelf) <|endoftext|>"
OWN_PROBLEM = """(define (problem my-kitchen) (:domain manipulation)
  (:objects sideboard_2 - fixture grandmas_samovar - vessel)
  (:init (inworkspace table) (inworkspace sideboard_2) (inworkspace grandmas_samovar) (on grandmas_samovar table))
  (:goal (on grandmas_samovar sideboard_2)))"""


@pytest.fixture(scope="module")
def checkpoint(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An untrained double head over a BPE of a few words."""
    folder = tmp_path_factory.mktemp("model")
    tokenizer = BpeTokenizer.train([f"{prompt} {TEXT}" for prompt in PROMPTS], 300)
    torch.manual_seed(3)
    sizes = {"n_positions": 512, "n_embd": 32, "n_layer": 2, "n_head": 2}
    ends = {"bos_token_id": tokenizer.start_id, "eos_token_id": tokenizer.end_id, "pad_token_id": tokenizer.end_id}
    GPT2DoubleHeadsModel(GPT2Config(vocab_size=tokenizer.vocab_size, **sizes, **ends)).save_pretrained(folder)
    tokenizer.save_pretrained(folder)
    RunConfig.load(None, ["tokenizer.kind=bpe"]).save(folder / "run.toml")
    return folder


def planner(checkpoint: Path, *overrides: str) -> Planner:
    config = RunConfig.load(None, ["generate.max_new=20", "generate.samples=3", "generate.beams=2", *overrides])
    return Planner.load(checkpoint, config.generate, seed=1, device="cpu")


@pytest.mark.parametrize("decode", ["greedy", "sample", "beam", "best-of-k"])
def test_every_way_of_decoding_answers_each_prompt(checkpoint: Path, decode: str) -> None:
    made = planner(checkpoint).complete(PROMPTS, decode)
    assert len(made.completions) == len(PROMPTS)
    assert all(0 < c.tokens <= 20 for c in made.completions)
    again = planner(checkpoint).complete(PROMPTS, decode)
    assert [c.text for c in made.completions] == [c.text for c in again.completions]


def test_the_oracle_chooses_what_it_accepts(checkpoint: Path) -> None:
    found = planner(checkpoint, "generate.rerank=oracle")
    drawn = found.draw(PROMPTS)
    wanted = {drawn.texts[1].text, drawn.texts[5].text}

    def judge(_: Any, texts: Any) -> list[bool]:
        return [text in wanted for text in texts]

    chosen = found.choose(drawn, rate(found, drawn, "oracle", judge))
    assert {c.text for c in chosen.completions} == wanted


def test_the_head_chooses_by_its_own_logit(checkpoint: Path) -> None:
    found = planner(checkpoint)
    drawn = found.draw(PROMPTS)
    logits = []
    for index in range(len(drawn.made)):
        ids = torch.tensor([[drawn.whole(index)]])
        with torch.no_grad():
            out = found.model(ids, mc_token_ids=torch.tensor([[ids.shape[-1] - 1]]))
        logits.append(float(out.mc_logits))
    best = [max(range(p * 3, p * 3 + 3), key=lambda i: (drawn.made[i].finished, logits[i])) for p in range(2)]
    chosen = found.choose(drawn, rate(found, drawn, "head"))
    assert [c.text for c in chosen.completions] == [drawn.texts[i].text for i in best]


def test_the_head_reads_texts_that_fill_the_context(checkpoint: Path) -> None:
    found = planner(checkpoint, "generate.max_new=600", "generate.samples=8")
    drawn = found.draw(PROMPTS)
    assert max(len(drawn.whole(i)) for i in range(len(drawn.made))) == found.model_context + 1
    assert all(map(math.isfinite, head_scores(found, drawn)))


def test_planning_anew_asks_from_the_state_that_was_written(checkpoint: Path) -> None:
    found = planner(checkpoint)
    made = found.complete(PROMPTS, "replan")
    first = [step[0] for step in found.first_steps(PROMPTS, 1)]
    for whole, step in zip(made.completions, first, strict=True):
        assert whole.text.startswith(step.text)
        assert step.text.count("<ACTION>") <= 1
    drawn = found.first_steps(PROMPTS, 3)
    assert all(len(steps) == 3 for steps in drawn)
    scores = [[step.log_probability for step in steps] for steps in drawn]
    assert scores == [sorted(found, reverse=True) for found in scores]


def test_an_unknown_way_of_decoding_is_suggested(checkpoint: Path) -> None:
    with pytest.raises(ConfigError, match="did you mean `greedy`"):
        planner(checkpoint).complete(PROMPTS, "gredy")


def test_a_problem_of_the_users_own_gets_a_checked_answer(
    checkpoint: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    domain = Path(str(files("strips_lm") / "domains" / "manipulation" / "domain.pddl"))
    problem = tmp_path / "kitchen.pddl"
    problem.write_text(OWN_PROBLEM)
    command = ["generate", str(checkpoint), str(domain), str(problem), "--set", "generate.max_new=30"]
    assert main(command) == 1, "an untrained model does not plan"
    out = capsys.readouterr().out
    assert "; valid" not in out
    assert main([*command, "--json"]) == 1
    found = json.loads(capsys.readouterr().out)
    assert found["valid"] is False
    assert "grandmas_samovar vessel" in found["prompt"]
