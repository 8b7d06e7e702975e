"""A data set's folder wherever fsspec reaches: `s3://`, `gs://`, `sftp://`, `memory://` and its other protocols.

Where the store can move a file, one is written under a temporary name and moved. Object stores cannot; there an upload
appears when it is complete and not before, which fsspec's own classes show by having no `mv` of their own.

No such store locks. A run holds one by a lease: a small file that it rewrites every `BEAT` seconds. Another run that
finds a lease watches it for `PATIENCE` seconds and takes over where it has not changed, so that no clock is compared
and a killed run delays the next one by that time. Two runs that begin in the same instant may both go on; they write
the same bytes. Needs the extra `remote`.
"""

from __future__ import annotations

import errno
import secrets
import threading
import time
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, Any

from strips_lm.config.names import ConfigError
from strips_lm.storage import LOCK, TEMPORARY, temporary

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from strips_lm.storage import Warn

BEAT = 3.0
"""Seconds between two writings of the lease."""

PATIENCE = 15.0
"""Seconds without a beat after which the run that held the lease is taken for dead."""


class RemoteFolder:
    """A folder of an fsspec file system. One operation at a time: not every protocol's client bears two."""

    def __init__(self, url: str) -> None:
        self._url = url.rstrip("/")
        self._files, root = _connect(self._url)
        self._root = str(root).rstrip("/")
        self._turn = threading.Lock()

    def __str__(self) -> str:
        return self._url

    @property
    def address(self) -> str:
        """The URL."""
        return self._url

    def names(self) -> set[str]:
        """Every file but hidden ones."""
        return {name for name in self._all() if not name.rpartition("/")[2].startswith(".")}

    def read(self, name: str) -> bytes | None:
        """The file's content, if it is there."""
        with self._reaching(name):
            return self._content(self._path(name))

    def write(self, name: str, content: bytes) -> None:
        """Uploads the file, under a temporary name first where the store can move it."""
        with self._reaching(name):
            path = self._path(name)
            if self._moves():
                self._files.makedirs(path.rpartition("/")[0], exist_ok=True)
                self._write_and_move(path, self._path(temporary(name)), content)
            else:
                self._files.pipe_file(path, content)

    @contextmanager
    def exclusive(self, warn: Warn) -> Iterator[None]:
        """Takes the lease and renews it until the end, on a connection of its own."""
        self._refuse_living(warn)
        lease, ended = RemoteFolder(self._url), threading.Event()
        lease._beat()
        beats = threading.Thread(target=lease._keep, args=(ended,), daemon=True)
        beats.start()
        try:
            self._sweep()
            yield
        finally:
            ended.set()
            beats.join()
            with suppress(OSError):
                self._remove(LOCK)

    def _refuse_living(self, warn: Warn) -> None:
        found = self.read(LOCK)
        if found is None:
            return
        warn(f"{self}: another run was writing here; waiting {PATIENCE:.0f} s to see whether it still is")
        end = time.monotonic() + PATIENCE
        while time.monotonic() < end:
            time.sleep(BEAT / 2)
            now = self.read(LOCK)
            if now is None:
                return
            if now != found:
                raise ConfigError(f"{self}: another run is writing here")

    def _keep(self, ended: threading.Event) -> None:
        while not ended.wait(BEAT):
            with suppress(OSError):  # a beat that is missed is no fault; the next one tells as well
                self._beat()

    def _beat(self) -> None:
        """Rewrites the lease; in place, since half of one tells as well that its owner lives."""
        with self._reaching(LOCK):
            if self._moves():
                self._files.makedirs(self._root, exist_ok=True)
            self._files.pipe_file(self._path(LOCK), secrets.token_bytes(16))

    def _sweep(self) -> None:
        for name in self._all():
            if name.rpartition("/")[2].startswith(".") and name.endswith(TEMPORARY):
                self._remove(name)

    def _all(self) -> list[str]:
        with self._reaching(""):
            self._files.invalidate_cache()
            try:
                return [str(path).removeprefix(f"{self._root}/") for path in self._files.find(self._root)]
            except FileNotFoundError:
                return []

    def _remove(self, name: str) -> None:
        with self._reaching(name), suppress(FileNotFoundError):
            self._files.rm_file(self._path(name))

    def _moves(self) -> bool:
        from fsspec import AbstractFileSystem  # noqa: PLC0415

        return type(self._files).mv is not AbstractFileSystem.mv

    def _write_and_move(self, path: str, partial: str, content: bytes) -> None:
        try:
            self._files.pipe_file(partial, content)
            self._files.mv(partial, path)
        except Exception:
            with suppress(Exception):
                self._files.rm_file(partial)
            if self._content(path) != content:  # else another attempt at the same file came first
                raise

    def _content(self, path: str) -> bytes | None:
        self._files.invalidate_cache()
        try:
            return bytes(self._files.cat_file(path))
        except FileNotFoundError:
            return None

    def _path(self, name: str) -> str:
        return f"{self._root}/{name}"

    @contextmanager
    def _reaching(self, name: str) -> Iterator[None]:
        """One operation; what the store's client raises becomes an `OSError` that names the file."""
        with self._turn:
            try:
                yield
            except Exception as error:
                reason = " ".join(str(error).split()) or type(error).__name__
                raise OSError(errno.EIO, reason, f"{self._url}/{name}".rstrip("/")) from error


def _connect(url: str) -> tuple[Any, str]:
    hint = "\nhint: pip install 'strips-lm[remote]'"
    try:
        from fsspec.core import url_to_fs  # noqa: PLC0415
    except ModuleNotFoundError:
        raise ConfigError(f"{url}: a URL needs the package fsspec{hint}") from None
    connect: Callable[..., tuple[Any, str]] = url_to_fs
    try:
        return connect(url, skip_instance_cache=True)
    except ImportError as error:
        raise ConfigError(f"{url}: {error}{hint}, or the package that is named") from None
    except ValueError as error:
        raise ConfigError(f"{url}: {error}") from None
    except Exception as error:
        raise OSError(errno.EIO, str(error) or type(error).__name__, url) from error
