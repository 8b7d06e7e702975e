"""Data sets made by the workers of a Ray cluster: the bytes of one machine, though workers are killed.

The tests with a cluster need Ray: `uv run --with ray pytest tests/test_cluster.py`; without it they are skipped.
"""

from __future__ import annotations

import dataclasses
import logging
import os
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from strips_lm.cli import main
from strips_lm.cluster import ClusterError, Order, make, ray_cluster
from strips_lm.config import ConfigError, RunConfig
from strips_lm.shards import shards, write_data_set
from strips_lm.sources import read_sources

if TYPE_CHECKING:
    from collections.abc import Iterator

OVERRIDES = [
    "data.pairs=1200",
    "data.suite_records=0",
    "data.problems_per_template=6",
    "data.random_problems=40",
    "data.states_per_start=150",
    "data.shard_records=20",
]
CONFIG = RunConfig.load(None, OVERRIDES)
SOURCES = read_sources("manipulation")


@pytest.fixture(scope="module")
def local(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """The data set as this process alone makes it."""
    out = tmp_path_factory.mktemp("local") / "set"
    write_data_set(out, CONFIG, SOURCES)
    return contents(out)


@pytest.fixture(scope="module")
def ray() -> Iterator[Any]:
    """Ray with two workers."""
    os.environ |= {"RAY_USAGE_STATS_ENABLED": "0", "RAY_ENABLE_UV_RUN_RUNTIME_ENV": "0"}
    module = pytest.importorskip("ray", reason="no ray: uv run --with ray pytest tests/test_cluster.py")
    module.init(num_cpus=2, log_to_driver=False, include_dashboard=False, logging_level=logging.ERROR)
    yield module
    module.shutdown()


def contents(folder: Path) -> dict[str, bytes]:
    """Every file, hidden ones too."""
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def busy_workers() -> list[int]:
    """Worker processes of this process's own Ray that have a shard in hand."""
    return [
        int(entry.name)
        for entry in Path("/proc").iterdir()
        if entry.name.isdigit() and title(entry).startswith("ray::make") and os.getpid() in ancestors(int(entry.name))
    ]


def title(entry: Path) -> str:
    try:
        return (entry / "cmdline").read_text(errors="replace")
    except OSError:
        return ""


def ancestors(process: int) -> list[int]:
    found = []
    while process > 1:
        try:
            process = int(Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[1])
        except OSError:
            break
        found.append(process)
    return found


@pytest.mark.usefixtures("ray")
def test_two_workers_make_the_bytes_of_one_process(local: dict[str, bytes], tmp_path: Path) -> None:
    ticks = []
    with ray_cluster() as make_shards:
        write_data_set(tmp_path, CONFIG, SOURCES, make_shards=make_shards, tick=lambda *tick: ticks.append(tick))
    assert contents(tmp_path) == local
    assert ticks[-1] == ("records", 1200, 1200)


@pytest.mark.usefixtures("ray")
@pytest.mark.skipif(sys.platform != "linux", reason="workers are found in /proc")
def test_a_killed_worker_costs_a_retry_and_not_a_record(local: dict[str, bytes], tmp_path: Path) -> None:
    killed: set[int] = set()

    def kill(what: str, done: int, _total: int) -> None:
        end = time.monotonic() + 30
        while what == "records" and 0 < done < 400 and len(killed) < 3 and time.monotonic() < end:
            if victims := busy_workers():
                os.kill(victims[0], signal.SIGKILL)
                killed.add(victims[0])
                return

    with ray_cluster() as make_shards:
        write_data_set(tmp_path, CONFIG, SOURCES, make_shards=make_shards, tick=kill)
    assert len(killed) == 3
    written = contents(tmp_path)
    partial = {name for name in written if name.endswith(".partial")}  # of a worker that was killed as it wrote
    assert {name: written[name] for name in written if name not in partial} == local


@pytest.mark.usefixtures("ray")
def test_a_cluster_goes_on_where_an_interrupted_run_stopped(local: dict[str, bytes], tmp_path: Path) -> None:
    write_data_set(tmp_path, CONFIG, SOURCES)
    (tmp_path / "manifest.json").unlink()
    lost = sorted(tmp_path.glob("data/*"))[::2]
    kept = {path: path.stat().st_mtime_ns for path in sorted(tmp_path.glob("data/*"))[1::2]}
    for path in lost:
        path.unlink()
    with ray_cluster() as make_shards:
        write_data_set(tmp_path, CONFIG, SOURCES, make_shards=make_shards)
    assert contents(tmp_path) == local
    assert {path: path.stat().st_mtime_ns for path in kept} == kept


@pytest.mark.usefixtures("ray")
def test_workers_that_do_not_see_the_folder_end_the_run() -> None:
    with ray_cluster() as make_shards, pytest.raises(ConfigError, match="sees another folder there"):
        write_data_set("memory://a/b", CONFIG, SOURCES, make_shards=make_shards)


@pytest.mark.usefixtures("ray")
def test_what_a_worker_cannot_write_is_told_with_its_file(tmp_path: Path) -> None:
    (tmp_path / "data").write_text("a file where the folder should be")
    with ray_cluster() as make_shards, pytest.raises(OSError, match="data") as raised:
        write_data_set(tmp_path, CONFIG, SOURCES, make_shards=make_shards)
    assert raised.value.strerror


def test_a_worker_of_another_version_is_refused(tmp_path: Path) -> None:
    shard = shards([("train", 20)], CONFIG)[0]
    order = Order("key", str(tmp_path), b"", "0.0.0", CONFIG, SOURCES, 1)
    with pytest.raises(ClusterError, match=r"this machine 0\.0\.0"):
        make(order, shard)


def test_a_worker_writes_a_shard_once(local: dict[str, bytes], tmp_path: Path) -> None:
    from strips_lm import __version__

    shard = shards([("train", 1000)], CONFIG)[7]
    (tmp_path / "run.toml").write_bytes(local["run.toml"])
    order = Order("once", str(tmp_path), local["run.toml"], __version__, CONFIG, SOURCES, 1)
    first = make(order, shard)
    assert (tmp_path / shard.name).read_bytes() == local[shard.name]
    when = (tmp_path / shard.name).stat().st_mtime_ns
    assert make(dataclasses.replace(order), shard) == first
    assert (tmp_path / shard.name).stat().st_mtime_ns == when


def test_an_address_where_nobody_answers_is_told_at_once(tmp_path: Path) -> None:
    pytest.importorskip("ray", reason="no ray: uv run --with ray pytest tests/test_cluster.py")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = f"127.0.0.1:{free.getsockname()[1]}"
    command = [sys.executable, "-m", "strips_lm", "gen-data", f"--out={tmp_path / 'set'}", "--cluster=ray"]
    environment = {**os.environ, "RAY_ADDRESS": address}
    run = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=60)
    assert (run.returncode, run.stdout) == (2, "")
    assert f"error: no Ray cluster answers at {address}" in run.stderr
    assert not (tmp_path / "set").exists()


def test_ray_is_imported_only_where_it_is_asked_for(tmp_path: Path) -> None:
    code = (
        "import sys; import strips_lm.cluster; from strips_lm.cli import main;"
        f"assert main(['gen-data', '--out={tmp_path / 'set'}', '--pairs=20', '--set=data.suite_records=0']) == 0;"
        "assert not {'ray', 'fsspec', 'torch'} & sys.modules.keys()"
    )
    subprocess.run([sys.executable, "-c", code], check=True, env=os.environ)


def test_jobs_are_a_tasks_threads(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    import contextlib

    from strips_lm import cluster
    from strips_lm.shards import here

    asked = []

    @contextlib.contextmanager
    def no_cluster(threads: int) -> Iterator[Any]:
        asked.append(threads)
        yield here

    monkeypatch.setattr(cluster, "ray_cluster", no_cluster)
    small = [f"--set={override}" for override in OVERRIDES]
    assert main(["gen-data", f"--out={tmp_path / 'one'}", "--cluster=ray", *small]) == 0
    assert main(["gen-data", f"--out={tmp_path / 'three'}", "--cluster=ray", "--jobs=3", *small]) == 0
    assert asked == [1, 3]
