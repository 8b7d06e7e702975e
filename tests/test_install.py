"""The oracle's commands need numpy and pyarrow alone; the learning commands say what they miss."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest

TOP = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def bare_environment(tmp_path_factory):
    """A virtual environment with the wheel, numpy and pyarrow, and nothing else; gives its `bin`."""
    uv = shutil.which("uv")
    assert uv, "uv builds the environment: python3 -m pip install uv"
    folder = tmp_path_factory.mktemp("bare")
    run = lambda *argv: subprocess.run([uv, *map(str, argv)], check=True, cwd=TOP, timeout=900)  # noqa: E731
    run("build", "--quiet", "--wheel", "--out-dir", folder / "dist", TOP)
    run("venv", "--quiet", folder / "venv")
    (wheel,) = (folder / "dist").glob("*.whl")
    python = folder / "venv" / "bin" / "python"
    run("pip", "install", "--quiet", "--python", python, "--no-deps", wheel, "numpy", "pyarrow")
    return folder / "venv" / "bin"


@pytest.mark.slow
def test_the_oracle_works_without_torch(bare_environment, cups, tmp_path):
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}

    def strips_lm(*argv: object) -> subprocess.CompletedProcess[str]:
        command = [str(bare_environment / "strips-lm"), *map(str, argv)]
        return subprocess.run(command, capture_output=True, text=True, timeout=120, env=environment, cwd=tmp_path)

    assert strips_lm("--help").returncode == 0
    counted = strips_lm("plans", *cups.args(), "--count")
    assert (counted.returncode, counted.stderr) == (0, "")
    (tmp_path / "my.plan").write_text("(pick red table)\n(put red shelf)\n")
    assert strips_lm("validate", *cups.args(), "my.plan").returncode == 0
    made = strips_lm("gen-data", "--out", "data", "--pairs", 200)
    assert made.returncode == 0, made.stderr
    trained = strips_lm("train", "data", "--out", "run")
    assert trained.returncode == 2
    assert "hint: pip install" in trained.stderr
