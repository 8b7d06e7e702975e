"""Writing a data set: files that appear whole or not at all, and go on where an interrupted run stopped.

`manifest.json` comes last. A shard is a function of the configuration alone, so a resumed run ends with the bytes of
one that was never stopped, wherever its shards are made: here (`here`) or on a cluster (`strips_lm.cluster`). Holds one
shard in memory, and the next while the last is written. Knows nothing of planning, nor of what kind of store it writes
to (`strips_lm.storage`). Never imports torch.
"""

from __future__ import annotations

import io
import json
from concurrent.futures import CancelledError, ThreadPoolExecutor
from dataclasses import asdict, dataclass
from threading import Event
from typing import TYPE_CHECKING, Any

import pyarrow as pa
import pyarrow.parquet as pq

from strips_lm.card import dataset_card
from strips_lm.config import RunConfig
from strips_lm.config.names import ConfigError
from strips_lm.storage import digest, open_store

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from concurrent.futures import Future
    from pathlib import Path

    from strips_lm._native import RecordStream
    from strips_lm.sources import DomainSources
    from strips_lm.storage import Digest, Store

    Tick = Callable[[str, int, int], None]
    Warn = Callable[[str], None]
    MakeShards = Callable[["Work"], Iterator[tuple["Shard", Digest]]]

CATEGORIES = ["negative_kind", "negative_verdict", "template", "style", "goal_style", "plan_count", "domain"]
"""Columns with few different values, written through a dictionary."""

ROW_GROUP = 4096
"""Rows of a Parquet row group: what a reader must hold at a time."""


TEXTS, WORDS = pa.string(), pa.list_(pa.string())

RECORDS = pa.schema(
    {
        "index": pa.int64(),
        "prompt": TEXTS,
        "completion": TEXTS,
        "negative": TEXTS,
        "plan": TEXTS,
        "negative_kind": TEXTS,
        "negative_verdict": TEXTS,
        "negative_step": pa.int32(),
        "problem_id": pa.int32(),
        "names": WORDS,
        "words": WORDS,
        "template": TEXTS,
        "style": TEXTS,
        "goal_style": TEXTS,
        "steps": pa.int32(),
        "optimal_steps": pa.int32(),
        "plan_count": TEXTS,
        "seed": pa.uint64(),
    }
)
"""A record's columns, which JSON does not say."""


@dataclass(frozen=True, slots=True)
class Shard:
    """One file of records."""

    split: str
    start: int
    stop: int
    name: str
    """Relative to the data set's folder."""

    @property
    def records(self) -> int:
        """How many records it holds."""
        return self.stop - self.start


@dataclass(frozen=True, slots=True)
class Work:
    """The shards that a data set needs, and what it takes to make them."""

    store: Store
    config: RunConfig
    sources: DomainSources
    stream: RecordStream
    wanted: list[Shard]
    there: set[str]
    """Names of files that an earlier run left."""


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


def here(work: Work) -> Iterator[tuple[Shard, Digest]]:
    """Makes the shards that are missing on this machine; one is made while the one before is written."""
    writer, stop = ThreadPoolExecutor(1), Event()
    try:
        before: tuple[Shard, Future[Digest]] | None = None
        for shard in work.wanted:
            if shard.name in work.there:
                future = writer.submit(_kept, work.store, shard.name)
            else:
                batch = table(work.stream.batch(shard.split, shard.start, shard.stop))
                future = writer.submit(write_table, work.store, shard.name, batch, stop)
            if before is not None:
                yield before[0], before[1].result()
            before = shard, future
        if before is not None:
            yield before[0], before[1].result()
    finally:
        stop.set()  # whoever interrupts waits for one row group at most
        writer.shutdown(cancel_futures=True)


def write_data_set(
    out: str | Path,
    config: RunConfig,
    sources: DomainSources,
    *,
    jobs: int = 0,
    make_shards: MakeShards = here,
    tick: Tick = lambda *_: None,
    warn: Warn = lambda _: None,
) -> bool:
    """Writes the data set to `out`, a folder or a URL, or goes on where an earlier run stopped.

    Returns whether there was anything left to write.

    Raises:
        ConfigError: the folder holds another data set, another run is writing it, or it cannot be reached from here.
        PddlError, DataError: the sources or the configuration are wrong; nothing is written then.
        OSError: a file cannot be written.
    """
    store = open_store(out)
    refuse_other(store, config, sources.texts)
    if store.read("manifest.json") is not None:
        return False
    tick("problems", 0, 1)
    stream = sources.stream(config, jobs)
    tick("problems", 1, 1)
    for line in stream.left_out:
        warn(line)
    with store.exclusive(warn):
        refuse_other(store, config, sources.texts)  # again, now that no other run can begin
        work = Work(store, config, sources, stream, shards(stream.splits, config), store.names())
        digests = _write_about(work) | _write_shards(work, make_shards, tick)
        _refuse_unseen(store, digests)
        files = {name: digests[name] for name in sorted(digests)}
        manifest = {"content_hash": config.content_hash(), "splits": dict(stream.splits), "files": files}
        store.write("manifest.json", (json.dumps(manifest, indent=1) + "\n").encode())
    return True


def refuse_other(store: Store, config: RunConfig, texts: dict[str, str]) -> None:
    """Raises `ConfigError` if the store has a data set other than the one that is asked for, naming what differs.

    `texts` are the files that it is made from, by name.
    """
    run = store.read("run.toml")
    if run is None:
        return
    old = RunConfig.parse(run.decode(), f"{store}/run.toml")
    before, now = ({"seed": run.seed, **asdict(run.data)} for run in (old, config))
    differing = [f"{key} = {before[key]!r}, not {now[key]!r}" for key in now if before[key] != now[key]]
    differing += [
        f"{name} has changed"
        for name, text in texts.items()
        if (kept := store.read(name)) is not None and kept != text.encode()
    ]
    if differing:
        raise ConfigError(
            f"{store}: holds a data set of another configuration: {'; '.join(differing)}\nhint: choose another folder"
        )


def _write_about(work: Work) -> dict[str, Digest]:
    """Writes everything but records; `run.toml` first, so that no other configuration finds an unclaimed folder."""
    contents = {"run.toml": work.config.text().encode()}
    contents |= {name: text.encode() for name, text in work.sources.texts.items()}
    contents["problems.parquet"] = encode(table(work.stream.problems()), "parquet")
    contents["README.md"] = dataset_card(work.config, work.stream.splits).encode()
    return {name: write_once(work.store, name, content) for name, content in contents.items()}


def write_once(store: Store, name: str, content: bytes) -> Digest:
    """Writes a file unless it is there; gives what it is."""
    found = read_digest(store, name)
    if found is None:
        store.write(name, content)
    return found or digest(content)


def _write_shards(work: Work, make_shards: MakeShards, tick: Tick) -> dict[str, Digest]:
    total, done = sum(shard.records for shard in work.wanted), 0
    digests = {}
    for shard, found in make_shards(work):
        digests[shard.name] = found
        done += shard.records
        tick("records", done, total)
    return digests


def _refuse_unseen(store: Store, digests: dict[str, Digest]) -> None:
    missing = sorted(set(digests) - store.names())
    if missing:
        raise ConfigError(f"{store}: {len(missing)} files were written and are not there, such as {missing[0]}")


def read_digest(store: Store, name: str) -> Digest | None:
    """What a file is, if it is there."""
    content = store.read(name)
    return None if content is None else digest(content)


def _kept(store: Store, name: str) -> Digest:
    found = read_digest(store, name)
    if found is None:
        raise ConfigError(f"{store}/{name} was there and is gone")
    return found


def write_table(store: Store, name: str, batch: pa.Table, stop: Event | None = None) -> Digest:
    """Writes a table in the format that its name ends with; gives what the file is.

    Raises:
        CancelledError: `stop` was set meanwhile.
    """
    content = encode(batch, name.rpartition(".")[2], stop)
    store.write(name, content)
    return digest(content)


def table(columns: dict[str, Any]) -> pa.Table:
    """An Arrow table over the oracle's flat arrays, without copying them."""
    return pa.table({name: _array(column) for name, column in columns.items()})


def _array(column: Any) -> pa.Array:
    """A column; numbers below 0 stand for what is not known."""
    if not isinstance(column, tuple):
        unknown = column < 0
        return pa.array(column, mask=unknown) if unknown.any() else pa.array(column)
    offsets, values = column
    if isinstance(values, tuple):
        return pa.ListArray.from_arrays(pa.array(offsets), _array(values))
    buffers = [None, pa.py_buffer(offsets), pa.py_buffer(values)]
    return pa.Array.from_buffers(pa.string(), len(offsets) - 1, buffers)


def encode(batch: pa.Table, extension: str, stop: Event | None = None) -> bytes:
    """The file of a table, `parquet` or `jsonl`.

    Raises:
        CancelledError: `stop` was set meanwhile.
    """
    sink = io.BytesIO()
    if extension == "jsonl":
        for part in _row_groups(batch, stop):
            sink.writelines(f"{json.dumps(row, ensure_ascii=False)}\n".encode() for row in part.to_pylist())
        return sink.getvalue()
    categories = [name for name in CATEGORIES if name in batch.column_names]
    with pq.ParquetWriter(sink, batch.schema, compression="zstd", use_dictionary=categories) as file:
        for part in _row_groups(batch, stop):
            file.write_table(part)
    return sink.getvalue()


def _row_groups(batch: pa.Table, stop: Event | None) -> Iterator[pa.Table]:
    """The table cut into row groups, one at least, until `stop` is set."""
    for start in range(0, max(batch.num_rows, 1), ROW_GROUP):
        if stop is not None and stop.is_set():
            raise CancelledError
        yield batch.slice(start, ROW_GROUP)
