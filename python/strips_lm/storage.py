"""Where a data set's files go: a folder of this machine, or any place that fsspec reaches (`strips_lm.remote`).

A store holds whole files under names such as `data/train-00000-of-00001.parquet`. A name shows all of a file or
nothing, whatever stops the process that writes it, and one run at a time holds a store. Names that begin with a dot
are the store's own. Knows nothing of what the files say. Never imports torch, nor fsspec unless a URL asks for it.
"""

from __future__ import annotations

import hashlib
import os
import secrets
import sys
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol
from urllib.parse import urlsplit
from urllib.request import url2pathname

from strips_lm.config.names import ConfigError

if sys.platform == "win32":
    import msvcrt
else:
    import fcntl

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from contextlib import AbstractContextManager

    Warn = Callable[[str], None]
    Digest = dict[str, Any]

LOCK = ".lock"
"""The name that says that a run is writing."""

TEMPORARY = ".partial"
"""What names of unfinished files end with."""


class Store(Protocol):
    """Files under names; `str(store)` is what messages call it."""

    @property
    def address(self) -> str:
        """What `open_store` takes to open the same store in another process."""

    def names(self) -> set[str]:
        """The files that are there, those of the store's own left out."""

    def read(self, name: str) -> bytes | None:
        """A file's content, or None where there is no such file."""

    def write(self, name: str, content: bytes) -> None:
        """Makes the file appear, whole; one of that name is replaced.

        Raises:
            OSError: it cannot be written; nothing is left under the name then.
        """

    def exclusive(self, warn: Warn) -> AbstractContextManager[None]:
        """Holds the store for one run, and removes what a killed run left under temporary names.

        Raises:
            ConfigError: another run holds it.
        """


def open_store(out: str | Path) -> Store:
    """The store at `out`, a path or a URL; nothing is made there yet.

    Raises:
        ConfigError: no such store can be reached from here, for want of a package or of the protocol.
    """
    protocol, is_url, _ = str(out).partition("://")
    if not is_url:
        return Folder(Path(out))
    if protocol == "file":
        return Folder(Path(url2pathname(urlsplit(str(out)).path)))
    from strips_lm.remote import RemoteFolder  # noqa: PLC0415  (fsspec is for URLs alone)

    return RemoteFolder(str(out))


def digest(content: bytes) -> Digest:
    """Size and SHA-256 of a file's content."""
    return {"bytes": len(content), "sha256": hashlib.sha256(content).hexdigest()}


def file_digest(path: Path) -> Digest:
    """Size and SHA-256 of a file, which is not held in memory."""
    with path.open("rb") as file:
        return {"bytes": path.stat().st_size, "sha256": hashlib.file_digest(file, "sha256").hexdigest()}


def temporary(name: str) -> str:
    """A name in the same folder that no other writer uses: two may be making the same file."""
    folder, slash, file = name.rpartition("/")
    return f"{folder}{slash}.{file}.{secrets.token_hex(4)}{TEMPORARY}"


class Folder:
    """A folder of this machine: files are flushed to the disk and renamed; the lock ends with the process."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def __str__(self) -> str:
        return str(self._path)

    @property
    def address(self) -> str:
        """The absolute path."""
        return str(self._path.absolute())

    def names(self) -> set[str]:
        """Every file but hidden ones."""
        paths = (path.relative_to(self._path) for path in self._path.rglob("*") if path.is_file())
        return {path.as_posix() for path in paths if not path.name.startswith(".")}

    def read(self, name: str) -> bytes | None:
        """The file's content, if it is there."""
        try:
            return (self._path / name).read_bytes()
        except (FileNotFoundError, NotADirectoryError):
            return None

    def write(self, name: str, content: bytes) -> None:
        """Writes under a temporary name, flushes and renames."""
        path, partial = self._path / name, self._path / temporary(name)
        path.parent.mkdir(parents=True, exist_ok=True)
        try:
            partial.write_bytes(content)
            _flush(partial)
            partial.replace(path)
            _flush(path.parent)
        except BaseException as error:
            with suppress(FileNotFoundError):
                partial.unlink()
            if isinstance(error, OSError) and error.errno is not None:
                raise OSError(error.errno, os.strerror(error.errno), str(path)) from error
            raise

    @contextmanager
    def exclusive(self, warn: Warn) -> Iterator[None]:  # noqa: ARG002  (the system answers at once, whoever was killed)
        """Makes the folder, if need be, and locks it."""
        self._path.mkdir(parents=True, exist_ok=True)
        lock = self._path / LOCK
        with lock.open("w") as file:
            try:
                _hold(file.fileno())
            except OSError:
                raise ConfigError(f"{self}: another run is writing here") from None
            self._sweep()
            yield
            if sys.platform != "win32":  # which removes no open file; the name alone locks nothing
                lock.unlink(missing_ok=True)

    def _sweep(self) -> None:
        for path in [*self._path.glob(f".*{TEMPORARY}"), *self._path.glob(f"*/.*{TEMPORARY}")]:
            path.unlink(missing_ok=True)


def _hold(file: int) -> None:
    """Locks the open file, or raises `OSError`; the system lets go of it when this process ends, however it ends."""
    if sys.platform == "win32":
        msvcrt.locking(file, msvcrt.LK_NBLCK, 1)
    else:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)


def _flush(path: Path) -> None:
    if sys.platform == "win32" and path.is_dir():
        return  # Windows opens no folders, and needs no flush of them
    handle = os.open(path, os.O_RDWR if path.is_file() else os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
