"""Data sets at fsspec URLs: the bytes of a local folder, whatever the store does on the way."""

from __future__ import annotations

import json
import random
import sys
import threading
import time
from typing import TYPE_CHECKING, ClassVar

import fsspec
import pytest
from fsspec.implementations.memory import MemoryFileSystem

from strips_lm import remote
from strips_lm.cli import main
from strips_lm.storage import open_store

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

SMALL = [
    "--pairs=200",
    "--seed=3",
    "--set=data.suite_records=0",
    "--set=data.problems_per_template=4",
    "--set=data.random_problems=20",
    "--set=data.states_per_start=100",
    "--set=data.shard_records=20",
]


class UnsureStore(MemoryFileSystem):
    """An object store that now and then refuses a file, or takes it and does not say so."""

    protocol = "unsure"
    store: ClassVar[dict] = {}
    pseudo_dirs: ClassVar[list] = [""]
    draw = random.Random(1)
    share = 0.15
    """Of operations that fail."""

    @classmethod
    def _strip_protocol(cls, path: str) -> str:
        return super()._strip_protocol(path.replace(f"{cls.protocol}://", "memory://"))

    def pipe_file(self, path: str, value: bytes, mode: str = "overwrite", **kwargs: object) -> None:
        if self.fails():
            if self.fails(0.5):
                super().pipe_file(path, value, mode, **kwargs)
            raise ConnectionError("the line was cut")
        super().pipe_file(path, value, mode, **kwargs)

    @classmethod
    def fails(cls, share: float | None = None) -> bool:
        return cls.draw.random() < (cls.share if share is None else share)


class UnsureServer(UnsureStore):
    """A server that can move files, and keeps the first half of one where the line is cut."""

    protocol = "unsureserver"
    store: ClassVar[dict] = {}
    pseudo_dirs: ClassVar[list] = [""]

    def pipe_file(self, path: str, value: bytes, mode: str = "overwrite", **kwargs: object) -> None:
        cut = self.fails()
        MemoryFileSystem.pipe_file(self, path, value[: len(value) // 2] if cut else value, mode, **kwargs)
        if cut:
            raise ConnectionError("the line was cut")

    def mv(self, path1: str, path2: str, **_: object) -> None:
        if self.fails():
            raise ConnectionError("the line was cut")
        self.store[self._strip_protocol(path2)] = self.store.pop(self._strip_protocol(path1))


@pytest.fixture(autouse=True)
def stores(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Empty stores, whose leases are watched for a short time."""
    monkeypatch.setattr(remote, "BEAT", 0.05)
    monkeypatch.setattr(remote, "PATIENCE", 0.3)
    for kind in (UnsureStore, UnsureServer):
        fsspec.register_implementation(kind.protocol, kind, clobber=True)
    yield
    for kind in (MemoryFileSystem, UnsureStore, UnsureServer):
        kind.store.clear()


@pytest.fixture(scope="module")
def local(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """The data set as a local folder has it."""
    out = tmp_path_factory.mktemp("local") / "set"
    assert gen_data(out) == 0
    return {path.relative_to(out).as_posix(): path.read_bytes() for path in out.rglob("*") if path.is_file()}


def gen_data(out: object, *extra: str) -> int:
    return main(["gen-data", f"--out={out}", *SMALL, *extra])


def contents(url: str) -> dict[str, bytes]:
    """Every file at the URL, hidden ones too."""
    files, root = fsspec.url_to_fs(url)
    return {path.removeprefix(f"{root}/"): files.cat_file(path) for path in files.find(root)}


def test_a_url_gets_the_bytes_of_a_local_folder(local: dict[str, bytes]) -> None:
    assert gen_data("memory://some/where") == 0
    assert contents("memory://some/where") == local


def test_a_file_url_is_the_local_folder(local: dict[str, bytes], tmp_path: Path) -> None:
    assert gen_data((tmp_path / "a set").as_uri()) == 0
    assert open_store(tmp_path / "a set").names() == set(local)


@pytest.mark.parametrize("protocol", ["unsure", "unsureserver"])
@pytest.mark.parametrize("seed", [1, 2])
def test_a_store_that_fails_at_random_shows_whole_files_alone(
    local: dict[str, bytes], protocol: str, seed: int, capsys: pytest.CaptureFixture[str]
) -> None:
    UnsureStore.draw.seed(seed)
    url, failures = f"{protocol}://bucket/set", 0
    while gen_data(url) != 0:
        failures += 1
        assert "the line was cut" in capsys.readouterr().err
        shown = {
            name: content for name, content in contents(url).items() if not name.rpartition("/")[2].startswith(".")
        }
        assert shown == {name: local[name] for name in shown}
        assert shown.keys() != local.keys()
        assert failures < 100
    assert failures > 2
    assert contents(url) == local


def test_what_an_interrupted_run_left_is_kept(local: dict[str, bytes]) -> None:
    url, files = "memory://some/where", MemoryFileSystem()
    assert gen_data(url) == 0
    files.rm_file("/some/where/manifest.json")
    lost = sorted(name for name in local if name.startswith("data/"))[3]
    files.rm_file(f"/some/where/{lost}")
    before = {path: files.modified(path) for path in files.find("/some/where")}
    assert gen_data(url) == 0
    assert contents(url) == local
    assert all(files.modified(path) == then for path, then in before.items())


def test_the_manifest_tells_what_lies_at_the_url(local: dict[str, bytes]) -> None:
    assert gen_data("memory://some/where") == 0
    manifest = json.loads(contents("memory://some/where")["manifest.json"])
    assert {name: entry["bytes"] for name, entry in manifest["files"].items()} == {
        name: len(content) for name, content in local.items() if name != "manifest.json"
    }


def test_another_configuration_is_refused_at_a_url(capsys: pytest.CaptureFixture[str]) -> None:
    assert gen_data("memory://some/where") == 0
    assert gen_data("memory://some/where", "--seed=4") == 2
    assert "memory://some/where: holds a data set of another configuration: seed = 3, not 4" in capsys.readouterr().err


def test_a_second_run_at_a_url_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    with open_store("memory://some/where").exclusive(print):
        time.sleep(0.2)
        assert gen_data("memory://some/where") == 2
    assert "another run is writing here" in capsys.readouterr().err
    assert gen_data("memory://some/where") == 0


def test_a_killed_runs_lease_ends(local: dict[str, bytes], capsys: pytest.CaptureFixture[str]) -> None:
    MemoryFileSystem().pipe_file("/some/where/.lock", b"of a run that was killed")
    MemoryFileSystem().pipe_file("/some/where/data/.train-00000-of-00005.parquet.0a.partial", b"half")
    assert gen_data("memory://some/where") == 0
    assert "another run was writing here" in capsys.readouterr().err
    assert contents("memory://some/where") == local
    assert threading.active_count() < 10


def test_a_missing_package_is_named(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    from fsspec.registry import known_implementations

    monkeypatch.setitem(known_implementations, "far", {"class": "no_such_package.Far", "err": "Install farfs for far"})
    assert gen_data("far://away") == 2
    assert "error: far://away: Install farfs for far\nhint: pip install 'strips-lm[remote]'" in capsys.readouterr().err
    assert gen_data("nosuch://away") == 2
    assert "error: nosuch://away: Protocol not known: nosuch" in capsys.readouterr().err
    monkeypatch.setitem(sys.modules, "fsspec.core", None)
    assert gen_data("memory://away") == 2
    assert "needs the package fsspec\nhint: pip install 'strips-lm[remote]'" in capsys.readouterr().err


def test_a_cluster_without_ray_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "ray", None)
    assert gen_data(tmp_path / "set", "--cluster=ray") == 2
    assert "`--cluster ray` needs the package ray\nhint: pip install 'strips-lm[ray]'" in capsys.readouterr().err
    assert not (tmp_path / "set").exists()
