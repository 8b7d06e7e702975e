"""The trial before a run: the fastest way to run its layers, measured once, kept by the run."""

import json
import re
import shutil

import pytest
import torch
from safetensors.torch import load_file

import blocks_data
from strips_lm import processor, tuning
from strips_lm import train as loop
from strips_lm.config import ConfigError, RunConfig
from strips_lm.model import ModelError
from strips_lm.train import train
from strips_lm.tuning import Choice, Trial, load_choice, pays

SMALL = [
    *("model.layers=2", "model.width=32", "model.context=400", "tokenizer.kind=bpe", "tokenizer.vocab_size=320"),
    *("train.step_tokens=600", "train.position_offset=8", "train.mc_start=0.0", "model.dropout=0.1"),
]
SECONDS = {("float32", False): 2.0, ("bfloat16", False): 1.0, ("bfloat16", True): 0.5, ("float32", True): 9.0}


def config(*more, kind="lm-head"):
    return RunConfig.load("tiny", [*SMALL, f"model.kind={kind}", "train.minutes=0", "train.steps=8", *more])


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    return blocks_data.write(tmp_path_factory.mktemp("blocks"))


@pytest.fixture
def measured(tmp_path, monkeypatch):
    """What is measured, as (precision, compiled, threads); passes take `SECONDS` on one thread, twice that on two."""
    found = []

    def seconds(objective, choice, _batch):
        choice.apply(objective)
        found.append((choice.precision, choice.compiled, choice.threads))
        return SECONDS[choice.precision, choice.compiled] * max(choice.threads, 1)

    monkeypatch.setattr(tuning, "_seconds", seconds)
    monkeypatch.setattr(tuning, "cache_folder", lambda: tmp_path / "cache")
    monkeypatch.setattr(tuning, "multiplies_bfloat16", lambda _device: False)
    monkeypatch.setattr(tuning, "_missing_compiler", lambda _device: "")
    monkeypatch.setattr(tuning, "COMPILE_SECONDS", 0.0)
    monkeypatch.setattr(tuning.torch, "get_num_threads", lambda: 2)
    yield found
    torch.set_num_threads(1)


@pytest.mark.parametrize(
    ("vendor", "amx", "avx512", "quicker"),
    [
        ("GenuineIntel", True, True, True),
        ("GenuineIntel", False, True, False),  # AMX hidden: half the speed of float32
        ("AuthenticAMD", False, True, True),
        ("GenuineIntel", False, False, False),
        ("AuthenticAMD", False, False, False),
    ],
)
@pytest.mark.parametrize("listed", [True, False])
def test_bfloat16_is_quicker_where_its_products_are(vendor, amx, avx512, quicker, listed, monkeypatch):
    said = {True: vendor, False: ""}
    monkeypatch.setattr(processor.platform, "machine", lambda: "x86_64" if listed else "AMD64")
    monkeypatch.setattr(processor, "_listed", lambda _about: said[listed])
    monkeypatch.setattr(processor.platform, "processor", lambda: f"Family 6 Model 207, {said[not listed]}")
    monkeypatch.setattr(processor.torch.cpu, "_is_amx_tile_supported", lambda: amx)
    monkeypatch.setattr(processor.torch.cpu, "_is_avx512_bf16_supported", lambda: avx512)
    assert processor.multiplies_bfloat16.__wrapped__(torch.device("cpu")) is quicker


def test_machines_with_and_without_amx_are_told_apart(monkeypatch):
    names = []
    for amx in (True, False):
        monkeypatch.setattr(processor.torch.cpu, "_is_amx_tile_supported", lambda amx=amx: amx)
        names.append(processor.processor_name.__wrapped__())
    assert names[0] == f"{names[1]} AMX"


class StoppedError(Exception):
    """Ends a run before its first step."""


def choice_of(run, data, out, monkeypatch):
    """What a run chooses; it takes no step."""

    def stop(*_):
        raise StoppedError

    monkeypatch.setattr(loop.Steps, "next", stop)
    with pytest.raises(StoppedError):
        train(run, data, out, shown=False)
    return load_choice(out)


def test_the_fastest_type_and_number_of_threads_are_chosen_and_compiling_where_it_pays(
    data, tmp_path, measured, monkeypatch
):
    asked = config("train.autotune=true", "train.minutes=5", "train.steps=0")
    assert choice_of(asked, data, tmp_path / "run", monkeypatch) == Choice("bfloat16", compiled=True, threads=1)
    assert measured == [
        *(("float32", False, 1), ("float32", False, 2)),
        *(("float32", False, 1), ("bfloat16", False, 1), ("bfloat16", True, 1)),
    ]


def test_types_are_measured_once_and_threads_each_time(data, tmp_path, measured, monkeypatch):
    asked = config("train.minutes=5", "train.steps=0")
    first = choice_of(asked, data, tmp_path / "one", monkeypatch)
    del measured[:]
    assert choice_of(asked, data, tmp_path / "two", monkeypatch) == first
    assert measured == [("float32", False, 1), ("float32", False, 2)]
    (kept,) = (tmp_path / "cache").iterdir()
    kept.write_text("{")
    assert choice_of(asked, data, tmp_path / "three", monkeypatch) == first
    monkeypatch.setattr(tuning, "processor_name", lambda: "another")
    del measured[:]
    choice_of(asked, data, tmp_path / "four", monkeypatch)
    assert ("bfloat16", False, 1) in measured


def test_what_the_configuration_says_is_not_tried(data, tmp_path, measured, monkeypatch):
    said = config("train.autotune=true", "train.precision=float32", "train.compile=never")
    assert choice_of(said, data, tmp_path / "said", monkeypatch) == Choice("float32", threads=1)
    assert {(precision, compiled) for precision, compiled, _ in measured} == {("float32", False)}
    del measured[:]
    for name, more in (("steps", ()), ("off", ("train.autotune=false", "train.steps=0", "train.minutes=5"))):
        assert choice_of(config(*more), data, tmp_path / name, monkeypatch) == Choice("float32")
    assert not measured
    lstm = config("train.autotune=true", kind="lstm")
    assert choice_of(lstm, data, tmp_path / "lstm", monkeypatch) == Choice("float32", threads=1)
    with pytest.raises(ConfigError, match="takes auto or true or false, not 'often'"):
        config("train.autotune=often")


@pytest.mark.usefixtures("measured")
@pytest.mark.parametrize("missing", [True, False])
def test_a_machine_that_cannot_compile_does_without_and_says_why(data, tmp_path, monkeypatch, capsys, missing):
    asked, plain = config("train.minutes=5", "train.steps=0"), tuning._seconds

    def fail(objective, choice, batch):
        if choice.compiled:
            raise RuntimeError("the linker is gone\nand more")
        return plain(objective, choice, batch)

    monkeypatch.setattr(tuning, "_seconds", fail)
    if missing:
        monkeypatch.setattr(tuning, "_missing_compiler", lambda _device: "there is no C++ compiler")
    why = "there is no C++ compiler" if missing else "the linker is gone"
    monkeypatch.setattr(loop.Steps, "next", None)
    for again in ("", "; measured by an earlier run"):
        with pytest.raises(TypeError):
            train(asked, data, tmp_path / "run", shown=True)
        assert load_choice(tmp_path / "run") == Choice("bfloat16", threads=1)
        assert f"not compiled: {why}{again})" in capsys.readouterr().err
    if missing:
        with pytest.raises(ModelError, match=re.escape(why)):
            choice_of(config("train.compile=always"), data, tmp_path / "always", monkeypatch)


def test_compiling_pays_where_it_saves_more_than_it_takes(data, tmp_path, measured, monkeypatch):
    known = Trial(float32=1.0, compiled=0.8, compile_seconds=30.0)
    assert [pays(budget, 1.0, known) for budget in (149.0, 151.0)] == [False, True]
    assert not pays(1e9, 1.0, Trial(float32=1.0, compiled=1.1, compile_seconds=1.0))
    assert not pays(1e9, 1.0, Trial(float32=1.0))
    monkeypatch.setattr(tuning, "COMPILE_SECONDS", 30.0)
    choice_of(config("train.minutes=1", "train.steps=0"), data, tmp_path / "short", monkeypatch)
    assert not any(compiled for _, compiled, _ in measured)


@pytest.mark.usefixtures("measured")
def test_a_resumed_run_keeps_its_choice_bit_for_bit(data, tmp_path, monkeypatch):
    asked = config("train.autotune=true", "train.compile=never")
    train(asked, data, tmp_path / "whole", shown=False)
    build = loop.Steps.next

    def stop_at_four(steps, fraction):
        if steps.run.progress.step == 4:
            raise StoppedError
        return build(steps, fraction)

    monkeypatch.setattr(loop.Steps, "next", stop_at_four)
    with pytest.raises(StoppedError):
        train(config("train.autotune=true", "train.compile=never", "train.save_minutes=1e-9"), data, tmp_path / "two")
    monkeypatch.setattr(loop.Steps, "next", build)
    monkeypatch.setitem(SECONDS, ("bfloat16", False), 3.0)
    shutil.rmtree(tmp_path / "cache")
    assert choice_of(asked, data, tmp_path / "now", monkeypatch).precision == "float32", "a new run chooses anew"
    monkeypatch.setattr(loop.Steps, "next", build)
    train(asked, data, tmp_path / "two", resumed=True, shown=False)
    assert json.loads((tmp_path / "two" / "tuning.json").read_text())["precision"] == "bfloat16"
    for name in ("model.safetensors", "optimizer.safetensors"):
        whole, pieced = (load_file(tmp_path / run / "last" / name) for run in ("whole", "two"))
        assert all(torch.equal(whole[key], pieced[key]) for key in whole)


def test_a_real_trial_takes_seconds(data, tmp_path, monkeypatch):
    monkeypatch.setattr(tuning, "cache_folder", lambda: tmp_path / "cache")
    found = choice_of(config("train.autotune=true"), data, tmp_path / "run", monkeypatch)
    assert found.precision in {"float32", "bfloat16"}
    (kept,) = (tmp_path / "cache").iterdir()
    times = json.loads(kept.read_text())
    assert times["float32"] > 0.0
    assert times["bfloat16"] > 0.0
    assert times["compiled"] is None, "the run is too short for it"
    torch.set_num_threads(1)


def test_every_system_has_a_cache_folder(monkeypatch, tmp_path):
    for system, name in (("linux", "XDG_CACHE_HOME"), ("win32", "LOCALAPPDATA")):
        monkeypatch.setattr(tuning.sys, "platform", system)
        monkeypatch.setenv(name, str(tmp_path))
        assert tuning.cache_folder() == tmp_path / "strips-lm" / "tuning"
    monkeypatch.setattr(tuning.sys, "platform", "darwin")
    assert tuning.cache_folder().parts[-4:] == ("Library", "Caches", "strips-lm", "tuning")
