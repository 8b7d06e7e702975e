"""Under the oracle's mask even a model that knows nothing writes only steps that can be executed."""

from __future__ import annotations

import json
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

torch = pytest.importorskip("torch")
torch.set_num_threads(1)

from transformers import GPT2Config, GPT2LMHeadModel  # noqa: E402

from strips_lm import _native  # noqa: E402
from strips_lm.cli import main  # noqa: E402
from strips_lm.config import ConfigError, RunConfig  # noqa: E402
from strips_lm.decode.decoders import decoders_of  # noqa: E402
from strips_lm.decode.gpt2 import Gpt2Decoder  # noqa: E402
from strips_lm.decode.loop import pad  # noqa: E402
from strips_lm.decode.lstm import LstmDecoder  # noqa: E402
from strips_lm.decode.search import SearchLoop  # noqa: E402
from strips_lm.evaluate.evaluation import Evaluation  # noqa: E402
from strips_lm.evaluate.suites import DataFolder  # noqa: E402
from strips_lm.generate import GUIDED, Batch, Planner  # noqa: E402
from strips_lm.guide import Tasks  # noqa: E402
from strips_lm.lstm import LstmConfig, LstmLMHeadModel  # noqa: E402
from strips_lm.replan import Encoded  # noqa: E402
from strips_lm.tokenizer import BpeTokenizer, CanonicalTokenizer  # noqa: E402

if TYPE_CHECKING:
    from collections.abc import Sequence

MANIPULATION = Path(str(files("strips_lm"))) / "domains" / "manipulation"
PROBLEM = """(define (problem small-{number}) (:domain manipulation)
  (:objects shelf_{number} - fixture samovar - vessel {extra})
  (:init (inworkspace table) (inworkspace shelf_{number}) (inworkspace samovar) (on samovar table) {more})
  (:goal (and {goal})))"""
EXTRAS = (
    ("", ""),
    ("tea - movable", "(inworkspace tea) (on tea table)"),
    ("tea cake - movable", "(inworkspace tea) (inworkspace cake) (on tea table) (on cake table)"),
)
GOALS = ("(on samovar shelf_{number})", "(opened samovar)", "(inhand samovar)", "(on samovar table)")
AS_WRITTEN = ["generate.shorten=false"]
OLD = ["generate.backtrack=false", "generate.renew_steps=0", *AS_WRITTEN]
KEYS = ["generate.workers=1", "generate.max_new=400"]


class Questions:
    """Problems, their prompts, and the oracle's judgement of answers."""

    def __init__(self, domain: Path, problems: Sequence[str]) -> None:
        self.domain = _native.Domain.parse(domain.read_bytes())
        self.problems = [_native.Problem.parse(text, self.domain) for text in problems]
        self.tasks = [_native.Task(self.domain, problem) for problem in self.problems]
        self.actions = [name for name, _ in self.domain.actions]
        self.prompts = [_native.render_prompt(task, "typed", self.actions) for task in self.tasks]

    def oracle(self) -> Tasks:
        def find(prompts: Sequence[int]) -> tuple[list[_native.Task], list[Sequence[str]]]:
            names = [[name for name, _ in self.problems[i].objects] for i in prompts]
            return [self.tasks[i] for i in prompts], names

        return Tasks(self.domain, find)

    def judge(self, made: Batch) -> list[_native.Judgement]:
        problems = [problem.to_pddl() for problem in self.problems]
        words = [{name: name for name in self.actions}] * len(problems)
        return _native.judge(self.domain, problems, [c.text for c in made.completions], words)


@pytest.fixture(scope="module")
def questions() -> Questions:
    problems = []
    for goal in GOALS:
        for extra, more in EXTRAS:
            number = len(problems)
            problems.append(PROBLEM.format(number=number, extra=extra, more=more, goal=goal.format(number=number)))
    return Questions(MANIPULATION / "domain.pddl", problems)


def tokenizer() -> CanonicalTokenizer:
    domain = _native.Domain.parse((MANIPULATION / "domain.pddl").read_bytes())
    return CanonicalTokenizer(_native.CanonicalCodec(domain), 16)


def untrained(seed: int, positions: int = 512, words: Any = None) -> Any:
    torch.manual_seed(seed)
    words = words or tokenizer()
    sizes = {"n_positions": positions, "n_embd": 32, "n_layer": 2, "n_head": 2}
    ends = {"bos_token_id": words.start_id, "eos_token_id": words.end_id}
    return GPT2LMHeadModel(GPT2Config(vocab_size=words.vocab_size, **sizes, **ends)).eval()


def untrained_lstm(seed: int = 5, words: Any = None) -> Any:
    torch.manual_seed(seed)
    sizes = {"embedding_size": 16, "hidden_size": 24}
    return LstmLMHeadModel(LstmConfig(vocab_size=(words or tokenizer()).vocab_size, **sizes)).eval()


def planner(seed: int = 1, *overrides: str) -> Planner:
    return Planner(untrained(seed), tokenizer(), RunConfig.load(None, [*KEYS, *overrides]).generate)


@pytest.fixture(scope="module")
def checkpoint(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("model")
    untrained(1).save_pretrained(folder)
    tokenizer().save_pretrained(folder)
    return folder


@pytest.mark.parametrize("decode", GUIDED)
@pytest.mark.parametrize("seed", range(5))
def test_every_step_can_be_executed_and_every_text_that_ends_is_valid(
    questions: Questions, seed: int, decode: str
) -> None:
    made = planner(seed).complete(questions.prompts, decode, tasks=questions.oracle())
    for completion, judgement in zip(made.completions, questions.judge(made), strict=True):
        assert judgement.executable_steps == judgement.steps
        assert completion.finished == judgement.finished
        assert judgement.states_right == judgement.states_total == judgement.steps
        assert completion.finished == judgement.verdict.is_valid
    assert any(c.finished and c.choices for c in made.completions)


@pytest.mark.parametrize("decode", GUIDED)
@pytest.mark.parametrize("seed", range(5))
def test_no_state_comes_twice(questions: Questions, seed: int, decode: str) -> None:
    made = planner(seed).complete(questions.prompts, decode, tasks=questions.oracle())
    for completion in made.completions:
        steps = _native.parse_completions([completion.text])[0].steps
        states = [frozenset((name, *parts) for name, parts in state or ()) for _, state in steps]
        assert len(set(states)) == len(states)


@pytest.mark.parametrize("decode", GUIDED)
def test_a_goal_that_holds_already_needs_no_step(questions: Questions, decode: str) -> None:
    made = planner().complete(questions.prompts, decode, tasks=questions.oracle()).completions
    done = [c for c, prompt in zip(made, questions.prompts, strict=True) if "<GOAL> on(samovar, table)" in prompt]
    assert len(done) == len(EXTRAS)
    assert all((c.tokens, c.finished, c.choices) == (1, True, 0) for c in done)


@pytest.mark.parametrize("decode", GUIDED)
@pytest.mark.parametrize("overrides", [["generate.rows=1"], ["generate.rows=3"], ["generate.workers=2"]])
def test_batch_size_and_threads_do_not_change_the_plans(
    questions: Questions, overrides: list[str], decode: str
) -> None:
    eight = planner(2, "generate.rows=8").complete(questions.prompts, decode, tasks=questions.oracle())
    other = planner(2, *overrides).complete(questions.prompts, decode, tasks=questions.oracle())
    assert [c.text for c in eight.completions] == [c.text for c in other.completions]
    assert eight.removed_share == pytest.approx(other.removed_share, rel=1e-4)


def test_what_the_mask_removed_is_the_models_own_probability(questions: Questions) -> None:
    found = planner(3, *OLD)
    ids, legends = found.tokenizer.encode_prompts(questions.prompts)
    made = found._guided(Encoded(questions.prompts, ids, legends), "masked", questions.oracle())
    for number, generation in enumerate(made):
        total, choices = slow_replay(found, questions, number, legends[number], list(map(int, ids[number])), generation)
        assert generation.choices == choices
        assert generation.removed == pytest.approx(total, rel=1e-4, abs=1e-6)


def slow_replay(
    found: Planner, questions: Questions, number: int, legend: Any, text: list[int], generation: Any
) -> tuple[float, int]:
    """The text token by token, the model asked anew at each choice: (removed, choices); the likeliest must be there."""
    words = tokenizer()
    guide = _native.MaskedDecoder(words.codec, words.words)
    _, ((*forced,),) = guide.add([questions.tasks[number]], [legend])
    total, choices, made = 0.0, 0, list(generation.tokens)
    while True:
        text, made = text + made[: len(forced)], made[len(forced) :]
        if not made:
            return total, choices
        mask = torch.from_numpy(guide.mask([0])[0])
        with torch.no_grad():
            share = found.model(torch.tensor([text])).logits[0, -1].softmax(-1)
        assert int((share * mask).argmax()) == made[0]
        total, choices = total + float(share[~mask].sum()), choices + 1
        forced = [made[0], *guide.advance([0], [made[0]])[0]]


def test_after_each_step_the_model_reads_the_state_in_a_new_prompt(questions: Questions) -> None:
    found, words = planner(3, *OLD), tokenizer()
    made = found.complete(questions.prompts, "masked-replan", tasks=questions.oracle()).completions
    plain = found.complete(questions.prompts, "masked", tasks=questions.oracle()).completions
    for prompt, task, completion in zip(questions.prompts, questions.tasks, made, strict=True):
        steps, choices = completion.text.split(" <ACTION> "), 0
        guide = _native.MaskedDecoder(words.codec, words.words)
        legend = words.encode_prompts([prompt])[1][0]
        _, ((*forced,),) = guide.add([task], [legend])
        (text,) = words.encode_prompts([prompt])[0]
        text, left = list(map(int, text)), list(completion.ids)
        while True:
            assert left[: len(forced)] == forced
            said, left = left[: len(forced)], left[len(forced) :]
            done = [i for i, token in enumerate(said) if i and token == words.ids["<ACTION>"]]
            if done:
                here = len(completion.ids) - len(left) - len(said) + done[-1]
                step = list(completion.ids)[:here].count(words.ids["<ACTION>"])
                state = steps[step - 1].rpartition("<STATE> ")[2]
                renewed = prompt.rpartition("<INIT> ")[0] + f"<INIT> {state}"
                text, said = list(map(int, words.encode_prompts([renewed])[0][0])), said[done[-1] :]
            text += said
            if not left:
                break
            mask = torch.from_numpy(guide.mask([0])[0])
            with torch.no_grad():
                share = found.model(torch.tensor([text])).logits[0, -1].softmax(-1)
            assert int((share * mask).argmax()) == left[0]
            choices += 1
            forced = [left[0], *guide.advance([0], [left[0]])[0]]
        assert completion.choices == choices
    assert [c.text for c in made] != [c.text for c in plain]


def without_objects(prompt: str) -> str:
    return prompt.replace(prompt[prompt.index("<OBJECTS>") : prompt.index("<GOAL>")], "")


def test_renewing_needs_prompts_that_list_their_objects(questions: Questions) -> None:
    bare = [without_objects(prompt) for prompt in questions.prompts]
    with pytest.raises(ConfigError, match="list their objects"):
        planner().complete(bare, "masked-replan", tasks=questions.oracle())


@pytest.mark.parametrize("decode", GUIDED)
def test_a_text_without_room_is_cut_after_a_whole_step(questions: Questions, decode: str) -> None:
    longest = max(len(ids) for ids in tokenizer().encode_prompts(questions.prompts)[0])
    model = untrained(4, positions=longest + 12)
    for config in (RunConfig.load(None, KEYS).generate, RunConfig.load(None, [*KEYS, "generate.max_new=7"]).generate):
        found = Planner(model, tokenizer(), config)
        ids, _ = found.tokenizer.encode_prompts(questions.prompts)
        made = found.complete(questions.prompts, decode, tasks=questions.oracle())
        judged = questions.judge(made)
        for row, completion, judgement in zip(ids, made.completions, judged, strict=True):
            room = model.config.n_positions + 1 - len(row) if decode == "search" else config.max_new
            assert completion.tokens <= min(config.max_new, room)
            assert judgement.executable_steps == judgement.steps == judgement.states_right
            assert completion.finished == judgement.verdict.is_valid
        roomy = decode != "search" and config.max_new > 7  # the others forget what is done, and find all plans
        assert roomy == all(c.finished for c in made.completions)


@pytest.mark.parametrize("decode", GUIDED)
def test_an_lstm_can_be_guided_too(questions: Questions, decode: str) -> None:
    found = Planner(untrained_lstm(), tokenizer(), RunConfig.load(None, KEYS).generate)
    made = found.complete(questions.prompts, decode, tasks=questions.oracle())
    judged = zip(made.completions, questions.judge(made), strict=True)
    assert all(judgement.verdict.is_valid for completion, judgement in judged if completion.finished)
    assert any(completion.finished for completion in made.completions)


@pytest.mark.parametrize("decode", ["greedy", "sample", "beam", "replan"])
def test_an_lstm_writes_by_itself_too(questions: Questions, decode: str) -> None:
    found = Planner(untrained_lstm(), tokenizer(), RunConfig.load(None, [*KEYS, "generate.max_new=20"]).generate)
    made = found.complete(questions.prompts, decode)
    assert all(0 < completion.tokens <= 20 or decode == "replan" for completion in made.completions)


@pytest.mark.parametrize("decode", ["search", "search-replan"])
@pytest.mark.parametrize("layout", ["difference", "progress", "report"])
def test_search_with_calls_enough_solves_everything(questions: Questions, layout: Any, decode: str) -> None:
    words = CanonicalTokenizer(_native.CanonicalCodec(questions.domain, layout=layout), 16)
    config = RunConfig.load(None, [*KEYS, "generate.search_calls=3000"]).generate
    found = Planner(untrained(6, 2048, words), words, config)
    made = found.complete(questions.prompts, decode, tasks=questions.oracle())
    solvable = [task.plan_set(8).shortest() is not None for task in questions.tasks]
    assert any(solvable)
    for solved, judgement, completion in zip(solvable, questions.judge(made), made.completions, strict=True):
        assert completion.finished or not solved
        assert completion.finished == judgement.verdict.is_valid


def test_a_search_that_renews_its_prompts_reads_the_last_state_and_the_step_begun(
    questions: Questions, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[tuple[int, list[int], list[int]]] = []
    rest = SearchLoop._rest

    def note(loop: SearchLoop, row: int, search: Any) -> list[int]:
        chunk = rest(loop, row, search)
        asked.append((search.job.prompt, list(search.now.tokens), list(search.held)))
        return chunk

    monkeypatch.setattr(SearchLoop, "_rest", note)
    words = tokenizer()
    planner(3, "generate.search_calls=40").complete(questions.prompts, "search-replan", tasks=questions.oracle())
    ids, legends = words.encode_prompts(questions.prompts)
    action = words.hf.convert_tokens_to_ids("<ACTION>")
    renewed = 0
    for number, tokens, held in asked:
        begin = max((i for i, token in enumerate(tokens) if token == action), default=0)
        prompt = questions.prompts[number]
        if begin:
            (done,) = words.decode_completions([ids[number]], [tokens[:begin]], [legends[number]])
            prompt = prompt.rpartition("<INIT> ")[0] + "<INIT> " + done.rpartition("<STATE> ")[2].strip()
            renewed += 1
        assert held == [*map(int, words.encode_prompts([prompt])[0][0]), *tokens[begin:]]
    assert renewed >= 5


@pytest.mark.parametrize("ways", [("masked", "search"), ("masked-replan", "search-replan")])
def test_by_discrepancy_the_model_s_favourites_come_first(questions: Questions, ways: tuple[str, str]) -> None:
    settings = ["generate.search_order=discrepancy", "generate.search_calls=3000", *OLD]
    found = planner(1, *settings)
    favourite, searched = (found.complete(questions.prompts, way, tasks=questions.oracle()).completions for way in ways)
    assert any(text.finished for text in favourite)
    for text, other in zip(favourite, searched, strict=True):
        assert other.text == text.text or not text.finished


def test_search_gives_up_after_its_calls(questions: Questions) -> None:
    made = planner(1, "generate.search_calls=2").complete(questions.prompts, "search", tasks=questions.oracle())
    assert all(c.choices <= 2 for c in made.completions)
    assert any(not c.finished for c in made.completions)
    assert all(j.executable_steps == j.steps == j.states_right for j in questions.judge(made))


def test_a_row_rewound_gives_the_logits_of_a_fresh_one(questions: Questions) -> None:
    ids = [list(map(int, row))[:20] for row in tokenizer().encode_prompts(questions.prompts[:2])[0]]
    model = untrained(7)
    for decoder in (Gpt2Decoder(model, 2), decoders_of(model)(2), LstmDecoder(untrained_lstm(), 2)):
        wanted = decoder.feed(0, *pad(ids, decoder.lengths.device))
        decoder.clear(0, 2)
        decoder.feed(0, *pad([ids[0][:9] + ids[1][:4], ids[1]], decoder.lengths.device))
        rest = [ids[0][decoder.rewind(0, 9) :], ids[1][decoder.rewind(1, 19) :]]
        torch.testing.assert_close(decoder.feed(0, *pad(rest, decoder.lengths.device)), wanted)


def test_a_text_as_it_stands_cannot_be_guided(questions: Questions) -> None:
    bpe = BpeTokenizer.train(questions.prompts, 300)
    found = Planner(untrained(1), bpe, RunConfig.load(None, KEYS).generate)
    with pytest.raises(ConfigError, match="only a model on canonical words"):
        found.complete(questions.prompts, "masked", tasks=questions.oracle())


def test_another_domain_is_refused(questions: Questions, cups: Any) -> None:
    other = Questions(cups.domain, [cups.problem.read_text()])
    with pytest.raises(ConfigError, match=r"trained on `manipulation`.* `cups`"):
        planner().complete(questions.prompts, "masked", tasks=other.oracle())


def test_without_the_problem_there_is_no_mask(questions: Questions) -> None:
    with pytest.raises(ConfigError, match="needs the problem"):
        planner().complete(questions.prompts, "masked")


def test_generate_answers_a_problem_of_the_users_own(
    checkpoint: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    problem = tmp_path / "kitchen.pddl"
    problem.write_text(PROBLEM.format(number=0, extra="", more="", goal="(on samovar shelf_0)"))
    command = ["generate", str(checkpoint), str(MANIPULATION / "domain.pddl"), str(problem), "--decode", "masked"]
    assert main([*command, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["valid"]
    assert found["choices"] > 0
    assert 0.0 < found["removed_share"] < 1.0
    assert main(command) == 0
    assert "the mask removed" in capsys.readouterr().out


def test_evaluate_sets_the_mask_apart(checkpoint: Path, tmp_path: Path) -> None:
    small = ["--pairs=60", "--seed=7", "--set=data.suite_records=12", "--set=data.random_problems=20"]
    few = ["--set=data.problems_per_template=4", "--set=data.states_per_start=100", "--jobs=1"]
    assert main(["gen-data", f"--out={tmp_path / 'data'}", *small, *few]) == 0
    keys = ['evaluate.decodes=["greedy", "masked"]', 'evaluate.suites=["seen"]', "evaluate.pairs=4"]
    config = RunConfig.load(None, [*KEYS, *keys])
    free, guided = Evaluation(config, DataFolder(tmp_path / "data"), lambda _: None).run([checkpoint]).scores
    assert (free.oracle_helps, free.removed_share) == (False, None)
    assert guided.oracle_helps
    assert 0.0 < (guided.removed_share or 0.0) < 1.0
    assert guided.executable_share == 1.0
    assert guided.valid == guided.prompts - guided.unfinished
    assert guided.valid > free.valid
