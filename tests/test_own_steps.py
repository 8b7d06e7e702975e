"""A model's own steps: what the oracle says of each against judging it alone, the file, and training on it."""

from __future__ import annotations

import json
import re
import shutil
import signal
from dataclasses import replace
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import pyarrow.parquet as pq
import pytest

torch = pytest.importorskip("torch")
torch.set_num_threads(1)

from safetensors.torch import load_file  # noqa: E402
from transformers import AutoConfig  # noqa: E402

from strips_lm import _native  # noqa: E402
from strips_lm import tokenizer as tokenizers  # noqa: E402
from strips_lm.batches import Dress, Plan, build_step  # noqa: E402
from strips_lm.config import ConfigError, RunConfig  # noqa: E402
from strips_lm.dataset import open_split, speaking, texts  # noqa: E402
from strips_lm.evaluate.likelihood import measure  # noqa: E402
from strips_lm.evaluate.suites import DataFolder  # noqa: E402
from strips_lm.generate import Planner  # noqa: E402
from strips_lm.own_steps import FILE, OwnStep, read, write  # noqa: E402
from strips_lm.replan import first_steps  # noqa: E402
from strips_lm.sample_steps import sample_steps, verdicts  # noqa: E402
from strips_lm.train import train  # noqa: E402
from test_data_sets import data, rows  # noqa: E402, F401  (a fixture is used by its name)
from test_train import interrupt_at  # noqa: E402
from test_train_processes import same_weights  # noqa: E402
from test_train_processes import train as train_processes  # noqa: E402

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

    from strips_lm.evaluate.suites import Item

SMALL = ["model.layers=1", "model.width=32", "train.minutes=0", "train.steps=6", "train.step_tokens=600"]
SETTINGS = [
    *SMALL,
    *("train.mc_start=0.4", "train.mc_share=0.5", "train.mc_weight=0.1", "train.select_from=1"),
    *("train.own_steps=20", "train.evaluate_every=0.2"),
]


class Parrot:
    """A model that says what records of the data set say, right or wrong, for their own prompts or for others'."""

    def __init__(self, items: Sequence[Item]) -> None:
        self.items = {item.prompt: item for item in items}
        self.config, self.seed = RunConfig.load("tiny").generate, 0

    def draw(self, prompts: Sequence[str], tick: Callable[[int], None]) -> Any:
        said = [item.completion if (i + self.seed) % 3 else item.negative for i, item in enumerate(self.items.values())]
        said[0] = said[0].removesuffix("<|endoftext|>")
        tick(len(prompts))
        made = [SimpleNamespace(prompt=i, finished=text.endswith(">")) for i, text in enumerate(said)]
        return SimpleNamespace(made=made, texts=[SimpleNamespace(text=text) for text in said])

    def first_steps(self, prompts: Sequence[str], count: int) -> list[list[Any]]:
        steps = [step for item in self.items.values() for step in first_steps(item.prompt, item.negative)]
        known = dict(steps)
        return [
            [SimpleNamespace(text=text) for text in (known.get(prompt, steps[0][1]), steps[i * 5 % len(steps)][1])][
                :count
            ]
            for i, prompt in enumerate(prompts)
        ]


def judged_alone(folder: DataFolder, step: OwnStep, items: dict[str, Any]) -> bool:
    """Whether a step holds in the problem that begins at its prompt's state."""
    item = items[re.sub("<INIT> .*", "", step.prompt)]
    atoms = re.findall(r"([^\s,()]+)\(([^()]*)\)|([^\s,()]+)", step.prompt.rpartition("<INIT> ")[2])
    init = " ".join(f"({name or alone} {' '.join(args.split(', '))})" for name, args, alone in atoms)
    problem = re.sub(
        r"\(:init.*?\)\s*\(:goal", lambda _: f"(:init {init}) (:goal", folder.problem(item), flags=re.DOTALL
    )
    (found,) = _native.judge(folder.domain, [problem], [step.step], [folder.words(item)])
    holds = found.executable_steps == found.steps == 1 and found.states_right == 1
    return holds and (found.verdict.is_valid or not found.finished)


def test_every_step_is_what_the_oracle_says_of_it_alone(data: Path) -> None:  # noqa: F811
    folder = DataFolder(data)
    items = folder.items("train", 80)
    ticks: list[int] = []
    parrot: Any = Parrot(items)
    found = sample_steps(parrot, folder, items, ticks.append)
    assert len(ticks) == 5, "once for each temperature"
    goals = {re.sub("<INIT> .*", "", item.prompt): item for item in items}
    assert len({(step.prompt, step.step) for step in found}) == len(found) > 200
    assert [step.right for step in found] == [judged_alone(folder, step, goals) for step in found]
    assert 40 < sum(step.right for step in found) < len(found) - 40
    assert all((step.verdict == "right") == step.right for step in found)


def test_verdicts_end_with_the_step_that_proves_a_negative_wrong(data: Path) -> None:  # noqa: F811
    folder = DataFolder(data)
    items = {item.index: item for item in folder.items("train", distinct=False)}
    for row in rows(data, "train")[:200]:
        item = items[row["index"]]
        right, wrong = _native.judge(
            folder.domain, [folder.problem(item)] * 2, [item.completion, item.negative], [folder.words(item)] * 2
        )
        assert verdicts(right) == [(place, "right") for place in range(1, row["steps"] + 1)]
        last = (min(row["negative_step"], wrong.steps), row["negative_verdict"])
        places = [place for place, _ in verdicts(wrong)]
        assert places == list(range(1, len(places) + 1)), "no step is left out, and none follows a wrong one"
        if wrong.first_wrong_state is not None:
            last = min(last, (wrong.first_wrong_state, "wrong_state"))
        assert verdicts(wrong)[-1:] == ([last] if wrong.steps else [])
        assert all(verdict == "right" for _, verdict in verdicts(wrong)[:-1])


@pytest.fixture
def own(data: Path, tmp_path: Path) -> Path:  # noqa: F811
    """A file of steps of the data set's records."""
    folder = DataFolder(data)
    items = folder.items("train", 60)
    parrot: Any = Parrot(items)
    write(tmp_path / "own.parquet", sample_steps(parrot, folder, items))
    return tmp_path / "own.parquet"


def test_steps_are_shown_whole_with_their_own_prompts(data: Path, own: Path) -> None:  # noqa: F811
    config = RunConfig.load("tiny")
    tokenizer = tokenizers.make(config.tokenizer, data, texts(data))
    training, held = read(own, speaking(tokenizer, data), 512)
    assert len(training.right) > 10 * len(held.right) > 0
    assert not set(training.right) & {*training.wrong, *held.right}
    found = replace(open_split(data, "train", tokenizer, 512), own_steps=training)
    plan = Plan(step_tokens=10**6, step_pairs=0, batch_tokens=10**6)
    for dress in (Dress(mc_share=1.0), Dress(mc_share=1.0, renumber_share=1.0, offset=20)):
        step = build_step(found, found.kept[:50], plan, dress, (0, 1))
        (batch,) = step.batches
        assert step.pairs == len(batch.mc_token_ids) == 50
        pools = [
            {(*training.prompts[i].tolist(), *training.steps[i].tolist()) for i in numbers}
            for numbers in (training.right, training.wrong)
        ]
        ids, places = batch.input_ids.flatten(), batch.position_ids.flatten()
        shown = []
        for right, wrong in batch.mc_token_ids.tolist():
            for last, pool in ((right, pools[0]), (wrong, pools[1])):
                first = last - int((places[: last + 1].flip(0).diff() == -1).long().cumprod(0).sum())
                row = tuple(ids[first : last + 1].tolist())
                shown.append(row in pool)
        assert all(shown) if dress.renumber_share == 0 else not all(shown)


def test_a_run_draws_its_own_steps_and_goes_on_bit_for_bit(
    data: Path,  # noqa: F811
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for more in ((), ("train.select_from=2",), ("tokenizer.kind=spelled", "model.context=600")):
        config = RunConfig.load("tiny", [*SETTINGS, *more])
        whole = tmp_path / f"whole-{len(more)}-{more}"
        assert train(config, data, whole, shown=False) == 0
        for stop in (1, 4):  # before they are drawn, and after
            pieced = tmp_path / f"pieced-{stop}-{more}"
            interrupt_at(stop, monkeypatch)
            assert train(config, data, pieced, shown=False) != 0
            monkeypatch.undo()
            assert (pieced / FILE).is_file() == (stop == 4)
            assert train(config, data, pieced, resumed=True, shown=False) == 0
            one, two = (load_file(folder / "last" / "model.safetensors") for folder in (whole, pieced))
            assert all(torch.equal(one[name], two[name]) for name in one)
            assert (whole / FILE).read_bytes() == (pieced / FILE).read_bytes()


def test_a_models_head_says_what_it_judges(data: Path, tmp_path: Path) -> None:  # noqa: F811
    (tmp_path / FILE).write_text("of an earlier run")
    assert train(RunConfig.load("tiny", SETTINGS), data, tmp_path, shown=False) == 0
    assert AutoConfig.from_pretrained(tmp_path / "last").judges_steps is True
    lines = [json.loads(line) for line in (tmp_path / "metrics.jsonl").read_text().splitlines()]
    measured = [line["mc_accuracy"] for line in lines if line["kind"] == "validation"]
    assert measured[0] is None, "no steps are drawn yet"
    assert all(0.0 <= accuracy <= 1.0 for accuracy in measured[2:])
    domain = DataFolder(data).domain
    planner = Planner.load(tmp_path, RunConfig.load("tiny").generate, device="cpu").for_domain(domain)
    found = measure(planner, "m", "seen", DataFolder(data).items("seen", 20))
    assert found.choices == 20
    texts = RunConfig.load("tiny", [*SETTINGS, "train.own_steps=0"])
    assert train(texts, data, tmp_path / "texts", shown=False) == 0
    assert AutoConfig.from_pretrained(tmp_path / "texts" / "last").judges_steps is False


def test_a_signal_while_steps_are_drawn_ends_the_run_with_a_checkpoint(
    data: Path,  # noqa: F811
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    draw = Planner.draw

    def interrupted(self: Planner, prompts: Sequence[str], tick: Any) -> Any:
        signal.raise_signal(signal.SIGTERM)
        return draw(self, prompts, tick)

    with monkeypatch.context() as patched:
        patched.setattr(Planner, "draw", interrupted)
        assert train(RunConfig.load("tiny", SETTINGS), data, tmp_path, shown=False) == signal.SIGTERM
    assert not (tmp_path / FILE).is_file()
    assert train(RunConfig.load("tiny", SETTINGS), data, tmp_path, resumed=True, shown=False) == 0
    assert (tmp_path / FILE).is_file()


def test_a_run_in_minutes_draws_for_as_many_prompts_as_it_has_time_for(
    data: Path,  # noqa: F811
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("strips_lm.second_head.AT_ONCE", 10)
    monkeypatch.setattr("strips_lm.second_head.SHARE", 0.0)
    brief = ("train.steps=0", "train.minutes=0.1", "train.autotune=false", "train.own_steps=1000")
    prompts = {}
    for name, more in (("brief", brief), ("whole", ("train.own_steps=20",))):
        assert train(RunConfig.load("tiny", [*SETTINGS, *more]), data, tmp_path / name, shown=False) == 0
        table = pq.read_table(tmp_path / name / FILE).to_pylist()
        prompts[name] = {re.sub("<INIT> .*", "", row["prompt"]) for row in table}
    assert 0 < len(prompts["brief"]) <= 10 < len(prompts["whole"]) <= 20


@pytest.mark.slow
def test_two_processes_judge_the_steps_that_one_of_them_draws(data: Path, tmp_path: Path) -> None:  # noqa: F811
    exact = ("train.optimizer=adam", "train.precision=float32", "model.dropout=0.0")
    assert train(RunConfig.load("tiny", [*SETTINGS, *exact]), data, tmp_path / "first", shown=False) == 0
    run, first = tmp_path / "given.toml", f"model.initial={tmp_path / 'first' / 'last'}"
    RunConfig.load("tiny", [*SETTINGS, *exact, "train.mc_start=0.0", first]).save(run)
    for world in (1, 2):
        train_processes(data, tmp_path / str(world), run, world)
    one, two = (tmp_path / world for world in ("1", "2"))
    assert (one / FILE).read_bytes() == (two / FILE).read_bytes()
    same_weights(*(load_file(folder / "last" / "model.safetensors") for folder in (one, two)), slack=1e-3)


def test_a_judge_needs_a_model_to_judge(data: Path, tmp_path: Path) -> None:  # noqa: F811
    with pytest.raises(ConfigError, match="from an untrained model"):
        train(RunConfig.load("judge"), data, tmp_path, shown=False)


def test_a_mixture_is_refused(data: Path, tmp_path: Path) -> None:  # noqa: F811
    for name in ("one", "other"):
        shutil.copytree(data, tmp_path / "mixture" / name)
    with pytest.raises(ConfigError, match="not with a mixture"):
        train(RunConfig.load("tiny", SETTINGS), tmp_path / "mixture", tmp_path / "run", shown=False)


def test_files_of_before_are_read_unless_they_ask_for_what_is_gone(tmp_path: Path) -> None:
    text = (
        RunConfig.load("tiny").text().replace("own_steps = 0\n", 'own_negatives = ""\nown_share = 0.0\nown_steps = 0\n')
    )
    (tmp_path / "run.toml").write_text(text)
    assert RunConfig.load(tmp_path / "run.toml") == RunConfig.load("tiny")
    (tmp_path / "run.toml").write_text(text.replace('own_negatives = ""', 'own_negatives = "own.parquet"'))
    with pytest.raises(ConfigError, match=r"no field `train\.own_negatives`"):
        RunConfig.load(tmp_path / "run.toml")
