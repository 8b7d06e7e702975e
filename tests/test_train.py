"""The loop: it learns, resumes bit for bit, obeys signals, stops on a loss that is no number."""

import json
import math
import os
import signal
import subprocess
import sys
import time

import pytest
import torch
from accelerate import Accelerator
from accelerate.utils import DistributedType, LoggerType
from safetensors.torch import load_file

import blocks_data
from strips_lm import prepare
from strips_lm import train as loop
from strips_lm.checkpoint import CheckpointError
from strips_lm.config import RunConfig
from strips_lm.model import ModelError, load_model
from strips_lm.train import NotFiniteError, rate, train

torch.set_num_threads(1)  # the models are so small that threads wait more than they work

KINDS = ("double-head", "lm-head", "lstm")


SMALL = (
    "train.own_steps=0",
    "model.layers=2",
    "model.width=32",
    "model.context=400",
    "tokenizer.kind=bpe",
    "tokenizer.vocab_size=320",
)


def config(kind="double-head", steps=12, *more):
    short = ["train.minutes=0", f"train.steps={steps}", "train.step_tokens=600", "train.position_offset=8"]
    heads = ["train.mc_start=0.0", "train.mc_share=0.5", "model.dropout=0.1", f"model.kind={kind}"]
    return RunConfig.load("tiny", [*SMALL, *short, *heads, *more])


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    return blocks_data.write(tmp_path_factory.mktemp("blocks"))


def metrics(out, kind="train"):
    lines = [json.loads(line) for line in (out / "metrics.jsonl").read_text().splitlines()]
    return [line for line in lines if line["kind"] == kind]


def weights(out):
    return load_file(out / "last" / "model.safetensors")


@pytest.mark.parametrize("kind", KINDS)
def test_it_learns(kind, data, tmp_path):
    assert train(config(kind, 60, "train.step_tokens=1500", "train.lr=0.01"), data, tmp_path, shown=False) == 0
    found = metrics(tmp_path, "validation")
    assert found[-1]["lm_loss"] < 0.75 * found[0]["lm_loss"]
    assert (found[-1]["mc_accuracy"] is None) == (kind != "double-head")
    assert found[-1]["floor"] == 0.0


@pytest.mark.parametrize("kind", KINDS)
def test_a_resumed_run_ends_bit_for_bit_where_an_uninterrupted_one_does(kind, data, tmp_path, monkeypatch):
    train(config(kind), data, tmp_path / "whole", shown=False)
    for stop in (1, 5, 11):
        out = tmp_path / f"stopped-{stop}"
        interrupt_at(stop, monkeypatch)
        assert train(config(kind), data, out, shown=False) == signal.SIGTERM
        monkeypatch.undo()
        assert train(config(kind), data, out, resumed=True, shown=False) == 0
        whole, pieced = weights(tmp_path / "whole"), weights(out)
        assert all(torch.equal(whole[name], pieced[name]) for name in whole), stop
        moments = [load_file(folder / "last" / "optimizer.safetensors") for folder in (tmp_path / "whole", out)]
        assert all(torch.equal(moments[0][name], moments[1][name]) for name in moments[0]), stop


def interrupt_at(step, monkeypatch):
    """Sends this process SIGTERM when that step begins."""
    build = loop.Steps.next

    def build_and_kill(steps, fraction):
        if steps.run.progress.step == step - 1:
            os.kill(os.getpid(), signal.SIGTERM)
        return build(steps, fraction)

    monkeypatch.setattr(loop.Steps, "next", build_and_kill)


def test_an_interrupted_run_has_trained_no_step_more(data, tmp_path, monkeypatch):
    interrupt_at(4, monkeypatch)
    assert train(config(), data, tmp_path, shown=False) == signal.SIGTERM
    assert json.loads((tmp_path / "last" / "trainer.json").read_text())["step"] == 4


def test_steps_built_ahead_are_the_same_steps(data, tmp_path, monkeypatch):
    for name, ahead in (("now", False), ("ahead", True)):
        monkeypatch.setattr(loop, "_builds_ahead", lambda _, ahead=ahead: ahead)
        train(config("double-head", 8, "train.mc_start=0.5"), data, tmp_path / name, shown=False)
    now, ahead = weights(tmp_path / "now"), weights(tmp_path / "ahead")
    assert all(torch.equal(now[name], ahead[name]) for name in now)


def test_accumulation_changes_nothing(data, tmp_path):
    plain = ("model.dropout=0.0", "train.precision=float32", "train.optimizer=adam", "train.position_offset=0")
    train(config("double-head", 10, *plain), data, tmp_path / "one", shown=False)
    train(config("double-head", 10, *plain, "train.batch_tokens=300"), data, tmp_path / "many", shown=False)
    one, many = (metrics(tmp_path / name)[-1] for name in ("one", "many"))
    assert many["lm_loss"] == pytest.approx(one["lm_loss"], rel=1e-4)
    assert many["mc_loss"] == pytest.approx(one["mc_loss"], rel=1e-4)


def poison_at(step, value, monkeypatch):
    """Puts a number into the weights before that step."""
    take = loop._take_step

    def poison(run, built, fraction):
        if run.progress.step == step - 1:
            next(run.whole_model().parameters()).data.fill_(value)
        return take(run, built, fraction)

    monkeypatch.setattr(loop, "_take_step", poison)


def test_a_loss_that_is_no_number_names_its_records_and_keeps_the_last_good_checkpoint(data, tmp_path, monkeypatch):
    poison_at(4, float("nan"), monkeypatch)
    with pytest.raises(NotFiniteError, match=r"step 4 or its gradient is not finite; its records: \d+"):
        train(config("double-head", 12, "train.save_minutes=1e-9"), data, tmp_path, shown=False)
    assert all(bool(weight.isfinite().all()) for weight in weights(tmp_path).values())
    assert json.loads((tmp_path / "last" / "trainer.json").read_text())["step"] == 3
    monkeypatch.undo()
    assert train(config(), data, tmp_path, resumed=True, shown=False) == 0


def test_a_gradient_that_is_no_number_stops_the_run_before_it_reaches_the_weights(data, tmp_path, monkeypatch):
    clip = Accelerator.clip_grad_norm_

    def overflow(self, parameters, most):
        parameters = list(parameters)
        parameters[0].grad.fill_(float("inf"))
        return clip(self, parameters, most)

    monkeypatch.setattr(Accelerator, "clip_grad_norm_", overflow)
    with pytest.raises(NotFiniteError, match="its gradient is not finite"):
        train(config(), data, tmp_path, shown=False)
    assert all(bool(weight.isfinite().all()) for weight in weights(tmp_path).values())


@pytest.mark.parametrize("kind", KINDS)
def test_checkpoints_load_with_plain_transformers(kind, data, tmp_path, recwarn, cli):
    from transformers import AutoModelForCausalLM, GPT2DoubleHeadsModel

    train(config(kind), data, tmp_path, shown=False)
    ours = load_model(tmp_path)
    ids = torch.arange(10)[None]
    if kind == "double-head":
        torch.testing.assert_close(
            GPT2DoubleHeadsModel.from_pretrained(tmp_path / "best")(ids).logits, ours(ids).logits
        )
    assert cli("export", tmp_path, "--out", tmp_path / "lm").code == 0
    assert cli("export", tmp_path, "--out", tmp_path / "lm").code == 2
    assert not (tmp_path / "lm" / "optimizer.safetensors").exists()
    theirs = AutoModelForCausalLM.from_pretrained(tmp_path / "lm").eval()
    torch.testing.assert_close(theirs(ids).logits, ours(ids).logits)
    assert not [warning for warning in recwarn if "Some weights" in str(warning.message)]
    for name in ("config.json", "model.safetensors", "tokenizer.json", "run.toml", "README.md"):
        assert (tmp_path / "best" / name).is_file()
    assert not list(tmp_path.rglob("*.pt")) + list(tmp_path.rglob("*.pkl")) + list(tmp_path.rglob("*.bin"))


def test_a_failed_write_leaves_the_earlier_checkpoint(data, tmp_path, monkeypatch):
    train(config(), data, tmp_path, shown=False)
    before = (tmp_path / "last" / "model.safetensors").read_bytes()

    def full(*_args, **_kwargs):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("strips_lm.checkpoint.save_file", full)
    with pytest.raises(CheckpointError, match=r"No space left on device; the earlier one is as it was"):
        train(config(steps=14), data, tmp_path, resumed=True, shown=False)
    assert (tmp_path / "last" / "model.safetensors").read_bytes() == before
    assert not list(tmp_path.glob(".*partial"))


@pytest.mark.skipif(sys.platform == "win32", reason="Windows limits no file's size")
def test_files_that_cannot_grow_leave_the_earlier_checkpoint(data, tmp_path):
    """The real thing, in a process of its own whose files may not pass 40 kB."""
    train(config(), data, tmp_path / "run", shown=False)
    before = {path.name: path.read_bytes() for path in (tmp_path / "run" / "last").iterdir()}
    text = (
        "import resource, sys; from strips_lm.cli import main; import torch\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (40_000, 40_000))\n"
        "sys.exit(main(sys.argv[1:]))"
    )
    more = ["--resume", "--set", "train.steps=14"]
    command = [sys.executable, "-c", text, "train", str(data), "--out", str(tmp_path / "run"), *more]
    done = subprocess.run(
        command, capture_output=True, text=True, timeout=300, env={**os.environ, "ACCELERATE_USE_CPU": "1"}
    )
    assert done.returncode == 2, done.stderr
    assert "checkpoint not written" in done.stderr
    assert "Traceback" not in done.stderr
    assert {path.name: path.read_bytes() for path in (tmp_path / "run" / "last").iterdir()} == before


def test_the_log_has_perplexity_its_floor_and_the_gap(data, tmp_path):
    train(config(), data, tmp_path, shown=False)
    line = metrics(tmp_path, "validation")[-1]
    assert line["perplexity"] == pytest.approx(math.exp(line["lm_loss"]))
    assert line["perplexity_floor"] == pytest.approx(math.exp(line["floor"]))
    assert line["gap"] == pytest.approx(line["lm_loss"] - line["floor"])


@pytest.mark.filterwarnings("ignore:.log_with:UserWarning")  # accelerate finds no tensorboard; ours stands in for it
def test_trackers_get_every_line(data, tmp_path, monkeypatch):
    logged = []
    monkeypatch.setattr(prepare, "get_available_trackers", lambda: [LoggerType.TENSORBOARD])
    monkeypatch.setattr(Accelerator, "init_trackers", lambda _self, name: logged.append(name))
    monkeypatch.setattr(Accelerator, "log", lambda _self, values, step: logged.append((values, step)))
    train(config("double-head", 20, "train.trackers=['tensorboard']"), data, tmp_path, shown=False)
    name, *lines = logged
    assert name == "strips-lm"
    assert len(lines) == len(metrics(tmp_path)) + len(metrics(tmp_path, "validation"))
    assert [step for values, step in lines if "train/lm_loss" in values] == [10, 20]
    assert [step for values, step in lines if "validation/gap" in values][-1] == 20


def test_a_launcher_that_takes_the_model_apart_its_own_way_is_refused(data, tmp_path, monkeypatch):
    monkeypatch.setattr(Accelerator, "distributed_type", DistributedType.DEEPSPEED)
    with pytest.raises(ModelError, match="DEEPSPEED is not supported"):
        train(config("lm-head", 2), data, tmp_path, shown=False)


def test_a_tracker_that_is_not_installed_is_named(data, tmp_path, monkeypatch):
    monkeypatch.setattr(prepare, "get_available_trackers", list)
    with pytest.raises(ModelError, match="no tracker `trackio` here"):
        train(config("lm-head", 2, "train.trackers=['trackio']"), data, tmp_path, shown=False)


def test_nothing_to_resume_says_so(data, tmp_path):
    with pytest.raises(CheckpointError, match="nothing to resume"):
        train(config(), data, tmp_path, resumed=True, shown=False)
    with pytest.raises(ModelError, match="no checkpoint"):
        load_model(tmp_path)


def test_the_rate_rises_stays_and_falls():
    recipe = config("lstm", 1, "train.warmup=0.1", "train.cooldown=0.4").train
    assert [round(rate(at, recipe), 3) for at in (0.0, 0.05, 0.1, 0.6, 0.8, 1.0)] == [0.01, 0.5, 1.0, 1.0, 0.5, 0.0]


def test_the_end_of_the_budget_in_minutes_ends_the_run(data, tmp_path):
    train(config("lstm", 0, "train.minutes=0.03"), data, tmp_path, shown=False)
    assert json.loads((tmp_path / "last" / "trainer.json").read_text())["seconds"] < 4


def wait_until(holds, seconds=240.0):
    end = time.monotonic() + seconds
    while not holds():
        assert time.monotonic() < end
        time.sleep(0.1)


@pytest.mark.skipif(sys.platform == "win32", reason="Windows sends no signal to one process")
def test_a_shell_sees_130_after_ctrl_c_and_143_after_sigterm_and_the_checkpoint_is_there(data, tmp_path):
    settings = [*SMALL, "train.steps=1000000", "train.minutes=0", "train.step_tokens=600"]
    environment = {**os.environ, "ACCELERATE_USE_CPU": "1", "OMP_NUM_THREADS": "1"}
    running = {}
    for number, code in ((signal.SIGINT, 130), (signal.SIGTERM, 143)):
        out = tmp_path / str(code)
        command = [sys.executable, "-m", "strips_lm", "train", str(data), "--out", str(out), "--model", "lm-head"]
        command += [f"--set={setting}" for setting in settings]
        script = ["sh", "-c", '"$@" & echo $!; wait $!; echo $?', "sh", *command]
        shell = subprocess.Popen(script, stdout=subprocess.PIPE, text=True, env=environment)
        running[out, number, code] = shell
    for (out, number, code), shell in running.items():
        wait_until(lambda out=out: (out / "metrics.jsonl").is_file() and metrics(out))
        os.kill(int(shell.stdout.readline()), number)
        said, _ = shell.communicate(timeout=120)
        assert said.split()[-1] == str(code)
        assert json.loads((out / "last" / "trainer.json").read_text())["step"] >= metrics(out)[-1]["step"]


def test_a_folder_without_a_data_set_is_named_with_what_makes_one(tmp_path, cli):
    result = cli("train", tmp_path / "nowhere", "--out", tmp_path / "run")
    assert result.code == 2
    assert "nowhere: no data set here\nhint: strips-lm gen-data --out" in result.err
    assert not (tmp_path / "run").exists()
