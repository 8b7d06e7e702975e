"""Shards as tasks of a Ray cluster: the one at `RAY_ADDRESS`, or one that is started here for the run.

A task is sent a shard's place and answers with the file's size and hash; records never pass through the driver. A
shard is a function of the configuration, and its file appears whole or not at all, so a task whose worker was killed is
run again and gives the same bytes. Each worker process solves the problems once and keeps them for its later tasks.

Every node needs Ray, this package in the same version, and the same way to the store: a path that all share, or a
URL and the credentials for it. Ray is imported only here, and only by `ray_cluster`. Needs the extra `ray`.
"""

from __future__ import annotations

import hashlib
import logging
import os
import socket
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import islice
from typing import TYPE_CHECKING, Any

from strips_lm._native import __version__
from strips_lm.config.names import ConfigError
from strips_lm.shards import read_digest, table, write_table
from strips_lm.storage import open_store

if TYPE_CHECKING:
    from collections.abc import Iterator

    from strips_lm._native import RecordStream
    from strips_lm.config import RunConfig
    from strips_lm.shards import MakeShards, Shard, Work
    from strips_lm.sources import DomainSources
    from strips_lm.storage import Digest, Store

RETRIES = 10
"""How often a shard is tried again after its worker died: machines may be taken away, but a shard that kills its
worker every time must end the run."""

IN_FLIGHT = 1000
"""Tasks that wait or run at a time, which bounds the driver's memory and lets a cluster that can grow see its load."""


ANSWER_SECONDS = 5.0
"""How long a cluster may take to answer."""


class ClusterError(ValueError):
    """The cluster cannot be reached or used, or its workers died too often."""


@dataclass(frozen=True, slots=True)
class Order:
    """What a worker needs to make any shard of a data set."""

    key: str
    """Names the data set among those that a worker knows."""
    address: str
    """Where the files go."""
    run_toml: bytes
    """What the store's `run.toml` says, by which a worker sees that it has the same store before it."""
    version: str
    """The driver's version of this package."""
    config: RunConfig
    sources: DomainSources
    threads: int


@contextmanager
def ray_cluster(threads: int = 1) -> Iterator[MakeShards]:
    """Connects to the cluster; gives what `write_data_set` makes shards with, `threads` CPUs for each task.

    Raises:
        ClusterError: Ray is not installed, or no cluster can be reached or started.
    """
    ray = _import_ray()
    connected = ray.is_initialized()
    if not connected:
        _connect(ray)
    try:
        yield lambda work: _shards(ray, work, threads)
    finally:
        if not connected:
            ray.shutdown()


def _import_ray() -> Any:
    # Neither is for a command line tool to decide: to send usage statistics, or to build environments on the nodes.
    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
    os.environ.setdefault("RAY_ENABLE_UV_RUN_RUNTIME_ENV", "0")
    try:
        import ray  # noqa: PLC0415
    except ModuleNotFoundError:
        raise ClusterError("`--cluster ray` needs the package ray\nhint: pip install 'strips-lm[ray]'") from None
    return ray


def _connect(ray: Any) -> None:
    address = os.environ.get("RAY_ADDRESS", "")
    _refuse_silent(ray, address)
    try:
        ray.init(logging_level=logging.ERROR, log_to_driver=False, include_dashboard=False)
    except (OSError, RuntimeError, ValueError) as error:
        where = f"the cluster at {address}" if address else "a cluster of this machine alone"
        hint = "\nhint: does it ask for a token? RAY_AUTH_MODE=token, as docs/cluster.md says" if address else ""
        raise ClusterError(f"Ray cannot use {where}: {' '.join(str(error).split())}{hint}") from error


def _refuse_silent(ray: Any, address: str) -> None:
    """Raises `ClusterError` where nobody answers; Ray itself would try for minutes. `auto` and the like are Ray's."""
    host, colon, port = address.removeprefix("ray://").rpartition(":")
    if not colon or not port.isdigit():
        return
    hosts = [host.strip("[]")]
    if hosts[0] in ("127.0.0.1", "localhost"):
        hosts.append(ray.util.get_node_ip_address())  # where Ray's head listens, whatever it is called
    reasons = [reason for reason in (_silence(host, int(port)) for host in hosts) if reason]
    if len(reasons) == len(hosts):
        raise ClusterError(f"no Ray cluster answers at {address}: {reasons[0]}\nhint: unset RAY_ADDRESS, or mend it")


def _silence(host: str, port: int) -> str:
    """Why nobody answers there; empty where somebody does."""
    try:
        socket.create_connection((host, port), timeout=ANSWER_SECONDS).close()
    except OSError as error:
        return str(error)
    return ""


def _shards(ray: Any, work: Work, threads: int) -> Iterator[tuple[Shard, Digest]]:
    """Has the cluster make the shards; in the order in which they are ready."""
    order = ray.put(_order(work, threads))
    task = ray.remote(num_cpus=threads, max_retries=RETRIES)(make)
    waiting = iter(work.wanted)
    running = {task.remote(order, shard): shard for shard in islice(waiting, IN_FLIGHT)}
    while running:
        ready, _ = ray.wait(list(running), num_returns=1)
        shard = running.pop(ready[0])
        yield shard, _answer(ray, ready[0], shard)
        running |= {task.remote(order, following): following for following in islice(waiting, 1)}


def _order(work: Work, threads: int) -> Order:
    run_toml = work.store.read("run.toml") or b""
    texts = repr((work.store.address, run_toml, sorted(work.sources.texts.items())))
    key = hashlib.sha256(texts.encode()).hexdigest()
    return Order(key, work.store.address, run_toml, __version__, work.config, work.sources, threads)


def _answer(ray: Any, ready: Any, shard: Shard) -> Digest:
    """A task's answer.

    Raises:
        ClusterError: the task failed for want of the package, or its workers died; what else it raised is raised here.
    """
    hint = f"\nhint: every node needs strips-lm {__version__}; docs/cluster.md"
    try:
        found: Digest = ray.get(ready)
    except ray.exceptions.RayTaskError as error:
        cause = error.cause if isinstance(error.cause, Exception) else error
        if isinstance(cause, ConfigError | ClusterError | OSError):
            raise cause from error
        raise ClusterError(f"{shard.name}: {cause}{hint}") from error
    except ray.exceptions.RayError as error:
        raise ClusterError(f"{shard.name}: {' '.join(str(error).split())}{hint}") from error
    return found


_OPENED: dict[str, tuple[Store, RecordStream]] = {}
"""The data set that this worker process makes shards of, by its order's key."""


def make(order: Order, shard: Shard) -> Digest:
    """Runs on a worker: writes the shard, unless it is there already, and tells what it is."""
    if order.key not in _OPENED:
        _OPENED.clear()
        _OPENED[order.key] = _open(order)
    store, stream = _OPENED[order.key]
    found = read_digest(store, shard.name)
    return found or write_table(store, shard.name, table(stream.batch(shard.split, shard.start, shard.stop)))


def _open(order: Order) -> tuple[Store, RecordStream]:
    node = socket.gethostname()
    if order.version != __version__:
        raise ClusterError(f"{node} has strips-lm {__version__}, this machine {order.version}")
    store = open_store(order.address)
    if store.read("run.toml") != order.run_toml:
        raise ConfigError(
            f"{store}: {node} sees another folder there\nhint: choose a path that every node shares, or a URL"
        )
    return store, order.sources.stream(order.config, order.threads)
