"""Ctrl-C in `gen-data`: answered within 200 ms wherever it comes, and the next run ends with the same bytes.

Each run is a process of its own that sends itself SIGINT from a thread as soon as the wanted moment is there, and says
when it did. The time until it says `interrupted` is what a user waits. As in `test_interrupts`, the best of some
attempts counts.
"""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from typing import TYPE_CHECKING

import pytest

from strips_lm.cli import main

if TYPE_CHECKING:
    from pathlib import Path

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="Windows sends no SIGINT to a child")

ATTEMPTS = 5
DATA = ["--pairs=15000", "--seed=7", "--jobs=2", "--set=data.suite_records=0", "--set=data.random_problems=3000"]
CHILD = """
import os, signal, sys, threading, time
from strips_lm import shards
from strips_lm.cli import main
from strips_lm.storage import Folder

def soon(delay):
    def send():
        time.sleep(delay)
        print(time.monotonic(), flush=True)
        os.kill(os.getpid(), signal.SIGINT)
    threading.Thread(target=send, daemon=True).start()

def on_write(start, delay):
    plain = Folder.write
    def write(self, name, content):
        if name.startswith(start):
            soon(delay)
        plain(self, name, content)
    Folder.write = write

{moment}
sys.exit(main(sys.argv[1:]))
"""
MOMENTS = {
    "reading files": "soon(0.02)",
    "solving problems of templates": "soon(0.1)",
    "solving random problems": "soon(0.4)",
    "writing the table of problems": "on_write('lexicon', 0.0)",
    "making and writing shards": "on_write('data/train-00000', 0.0)",
    "in the midst of a shard": "on_write('data/train-00000', 0.06)",
    "writing the last shard": "on_write('data/validation', 0.0)",
    "writing the manifest": "on_write('manifest', 0.0)",
}


@pytest.fixture(scope="module")
def wanted(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    out = tmp_path_factory.mktemp("whole") / "set"
    assert main(["gen-data", f"--out={out}", *DATA]) == 0
    return contents(out)


def contents(folder: Path) -> dict[str, bytes]:
    files = (path for path in folder.rglob("*") if path.is_file() and path.name != ".lock")
    return {str(path.relative_to(folder)): path.read_bytes() for path in files}


def seconds_to_answer(out: Path, moment: str) -> float | None:
    """From the signal to the line on stderr; nothing where the run was over before."""
    command = [sys.executable, "-c", CHILD.format(moment=moment), "gen-data", f"--out={out}", *DATA]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as child:
        assert child.stdout is not None
        assert child.stderr is not None
        line = child.stderr.readline()
        answered, code = time.monotonic(), child.wait(timeout=120)
        sent, rest = child.stdout.readline(), child.stderr.read()
    if line.endswith(": written\n"):  # The work was done: the signal met the end of the program, or came after it.
        assert code in {0, 130, -signal.SIGINT}
        return None
    assert (code, line, rest) == (130, "interrupted\n", "")
    return answered - float(sent)


@pytest.mark.parametrize("moment", MOMENTS)
def test_ctrl_c_is_answered_within_200_ms_and_the_next_run_ends_with_the_same_bytes(
    wanted: dict[str, bytes], tmp_path: Path, moment: str
) -> None:
    delays = []
    for attempt in range(ATTEMPTS):
        out = tmp_path / str(attempt)
        seconds = seconds_to_answer(out, MOMENTS[moment])
        assert {name: wanted[name] for name in files(out)} == files(out), "a file under its final name is not whole"
        if seconds is not None:
            delays.append(seconds)
        if delays and delays[-1] < 0.2:
            break
    assert delays, "the run was over before"
    assert min(delays) < 0.2, f"{moment}: answered after {', '.join(f'{delay:.3f}' for delay in delays)} s"
    assert main(["gen-data", f"--out={out}", *DATA]) == 0
    assert contents(out) == wanted


def files(folder: Path) -> dict[str, bytes]:
    """What is there under final names."""
    return {name: content for name, content in contents(folder).items() if not name.rpartition("/")[2].startswith(".")}
