"""Writing a data set: shards that appear whole or not at all, and go on where an interrupted run stopped.

Each file is written under a temporary name in its folder, flushed to the disk and renamed; `manifest.json` comes last.
A shard is a function of the configuration alone, so a resumed run ends with the bytes of one that was never stopped.
Holds one shard in memory, and the next while the last is written. Knows nothing of planning. Never imports torch.
"""

from __future__ import annotations

import hashlib
import json
import os
import sys
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import pyarrow as pa
import pyarrow.parquet as pq

from strips_lm.card import dataset_card
from strips_lm.config import RunConfig
from strips_lm.config.names import ConfigError

if sys.platform == "win32":
    import msvcrt
else:
    import fcntl

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from strips_lm._native import RecordStream
    from strips_lm.sources import DomainSources

    Tick = Callable[[str, int, int], None]

CATEGORIES = ["negative_kind", "negative_verdict", "template", "style", "goal_style", "plan_count", "domain"]
"""Columns with few different values, written through a dictionary."""

ROW_GROUP = 4096
"""Rows of a Parquet row group: what a reader must hold at a time."""

TEMPORARY = ".partial"
"""What names of unfinished files end with."""


@dataclass(frozen=True, slots=True)
class Shard:
    """One file of records."""

    split: str
    start: int
    stop: int
    name: str
    """Relative to the data set's folder."""


def shards(splits: list[tuple[str, int]], config: RunConfig) -> list[Shard]:
    """The files of a data set, in order."""
    size, extension = config.data.shard_records, config.data.format
    found = []
    for split, records in splits:
        count = -(-records // size)
        for number in range(count):
            name = f"data/{split.replace('-', '_')}-{number:05d}-of-{count:05d}.{extension}"
            found.append(Shard(split, number * size, min(records, (number + 1) * size), name))
    return found


def write_data_set(
    out: Path,
    config: RunConfig,
    sources: DomainSources,
    *,
    jobs: int = 0,
    tick: Tick = lambda *_: None,
    warn: Callable[[str], None] = lambda _: None,
) -> bool:
    """Writes the data set into the folder `out`, or goes on where an earlier run stopped.

    Returns whether there was anything left to write.

    Raises:
        ConfigError: the folder holds another data set, or another run is writing it.
        PddlError, DataError: the sources or the configuration are wrong; nothing is written then.
        OSError: a file cannot be written.
    """
    if (out / "run.toml").is_file():
        refuse_other(out, config, sources)
    if (out / "manifest.json").is_file():
        return False
    tick("problems", 0, 1)
    stream = sources.stream(config, jobs)
    tick("problems", 1, 1)
    for line in stream.left_out:
        warn(line)
    out.mkdir(parents=True, exist_ok=True)
    with _lock(out):
        _sweep(out)
        _write_sources(out, config, sources)
        _write_records(out, config, stream, tick)
        _write_once(out, "README.md", dataset_card(config, stream.splits).encode())
        manifest = {"content_hash": config.content_hash(), "splits": dict(stream.splits), "files": _digests(out)}
        _write_once(out, "manifest.json", (json.dumps(manifest, indent=1) + "\n").encode())
    return True


def refuse_other(out: Path, config: RunConfig, sources: DomainSources) -> None:
    """Raises `ConfigError` unless the folder's data set is the one that is asked for, naming what differs."""
    old = RunConfig.load(out / "run.toml")
    before, now = ({"seed": run.seed, **asdict(run.data)} for run in (old, config))
    differing = [f"{key} = {before[key]!r}, not {now[key]!r}" for key in now if before[key] != now[key]]
    differing += [
        f"{name} has changed"
        for name, text in sources.texts.items()
        if (out / name).is_file() and (out / name).read_text(encoding="utf-8") != text
    ]
    if differing:
        raise ConfigError(
            f"{out}: holds a data set of another configuration: {'; '.join(differing)}\nhint: choose another folder"
        )


@contextmanager
def _lock(out: Path) -> Iterator[None]:
    with (out / ".lock").open("w") as file:
        try:
            _hold(file.fileno())
        except OSError:
            raise ConfigError(f"{out}: another run is writing here") from None
        yield
        if sys.platform != "win32":  # which removes no open file; the name alone locks nothing
            (out / ".lock").unlink(missing_ok=True)


def _hold(file: int) -> None:
    """Locks the open file, or raises `OSError`; the system lets go of it when this process ends, however it ends."""
    if sys.platform == "win32":
        msvcrt.locking(file, msvcrt.LK_NBLCK, 1)
    else:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)


def _sweep(out: Path) -> None:
    """Removes what a killed run left under temporary names; nobody else writes here."""
    for path in [*out.glob(f".*{TEMPORARY}"), *out.glob(f"*/.*{TEMPORARY}")]:
        path.unlink()


def _write_sources(out: Path, config: RunConfig, sources: DomainSources) -> None:
    for name, text in sources.texts.items():
        _write_once(out, name, text.encode())
    if not (out / "run.toml").is_file():
        with _final(out / "run.toml") as partial:
            config.save(partial)


def _write_records(out: Path, config: RunConfig, stream: RecordStream, tick: Tick) -> None:
    """Writes the shards that are missing; one is made while the one before is written."""
    if not (out / "problems.parquet").is_file():
        _write_parquet(out / "problems.parquet", table(stream.problems()))
    wanted = shards(stream.splits, config)
    total, done = sum(shard.stop - shard.start for shard in wanted), 0
    write = _write_parquet if config.data.format == "parquet" else _write_jsonl
    with ThreadPoolExecutor(1) as writer:
        pending = None
        for shard in wanted:
            if not (out / shard.name).is_file():
                batch = table(stream.batch(shard.split, shard.start, shard.stop))
                if pending is not None:
                    pending.result()
                pending = writer.submit(write, out / shard.name, batch)
            done += shard.stop - shard.start
            tick("records", done, total)
        if pending is not None:
            pending.result()


def table(columns: dict[str, Any]) -> pa.Table:
    """An Arrow table over the oracle's flat arrays, without copying them."""
    return pa.table({name: _array(column) for name, column in columns.items()})


def _array(column: Any) -> pa.Array:
    if not isinstance(column, tuple):
        return pa.array(column)
    offsets, values = column
    if isinstance(values, tuple):
        return pa.ListArray.from_arrays(pa.array(offsets), _array(values))
    buffers = [None, pa.py_buffer(offsets), pa.py_buffer(values)]
    return pa.Array.from_buffers(pa.string(), len(offsets) - 1, buffers)


def _write_parquet(path: Path, batch: pa.Table) -> None:
    categories = [name for name in CATEGORIES if name in batch.column_names]
    with _final(path) as partial:
        pq.write_table(batch, partial, compression="zstd", use_dictionary=categories, row_group_size=ROW_GROUP)


def _write_jsonl(path: Path, batch: pa.Table) -> None:
    with _final(path) as partial, partial.open("w", encoding="utf-8") as file:
        file.writelines(json.dumps(row, ensure_ascii=False) + "\n" for row in batch.to_pylist())


def _write_once(out: Path, name: str, content: bytes) -> None:
    path = out / name
    if not path.is_file():
        with _final(path) as partial:
            partial.write_bytes(content)


@contextmanager
def _final(path: Path) -> Iterator[Path]:
    """A temporary name to write to, which becomes `path` once what was written is on the disk."""
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.parent / f".{path.name}{TEMPORARY}"
    try:
        yield partial
        _flush(partial)
        partial.replace(path)
        _flush(path.parent)
    except BaseException as error:
        with suppress(FileNotFoundError):
            partial.unlink()
        if isinstance(error, OSError) and error.errno is not None:
            raise OSError(error.errno, os.strerror(error.errno), str(path)) from error
        raise


def _flush(path: Path) -> None:
    if sys.platform == "win32" and path.is_dir():
        return  # Windows opens no folders, and needs no flush of them
    handle = os.open(path, os.O_RDWR if path.is_file() else os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def _digests(out: Path) -> dict[str, dict[str, Any]]:
    """Size and SHA-256 of every file of the data set."""
    paths = sorted(path for path in out.rglob("*") if path.is_file() and not path.name.startswith("."))
    return {path.relative_to(out).as_posix(): digest(path) for path in paths}


def digest(path: Path) -> dict[str, Any]:
    """Size and SHA-256 of one file."""
    with path.open("rb") as file:
        return {"bytes": path.stat().st_size, "sha256": hashlib.file_digest(file, "sha256").hexdigest()}
