"""What one task of `gen-data --cluster ray` costs, from which the size of a cluster follows (docs/cluster.md).

Runs what a worker runs, in this process and without Ray: the problems solved once, then shards made and written, with
one thread. CPU seconds, which a busy machine hardly changes; a cluster's own cost, the store's latency, comes on top.

    python benches/cluster_task.py [--shard-records 65536] [--shards 3] [--pairs 1000000000]
"""

from __future__ import annotations

import argparse
import resource
import tempfile
import time
from pathlib import Path

from strips_lm import __version__
from strips_lm.cluster import Order, make
from strips_lm.config import RunConfig
from strips_lm.shards import Shard
from strips_lm.sources import read_sources


def main() -> None:
    """Prints the costs of a worker's start and of a shard, and what follows for the whole."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--shard-records", type=int, default=65_536)
    parser.add_argument("--shards", type=int, default=3)
    parser.add_argument("--pairs", type=int, default=1_000_000_000)
    args = parser.parse_args()
    size = args.shard_records
    config = RunConfig.load(None, [f"data.pairs={args.pairs}", f"data.shard_records={size}"])
    sources = read_sources(config.data.domain)
    with tempfile.TemporaryDirectory() as folder:
        order = Order("bench", folder, b"", __version__, config, sources, threads=1)
        (Path(folder) / "run.toml").write_bytes(b"")
        start = time.process_time()
        make(order, Shard("train", 0, 1, "data/first.parquet"))
        solving = time.process_time() - start
        start, written = time.process_time(), 0
        for number in range(args.shards):
            shard = Shard("train", number * size, (number + 1) * size, f"data/{number}.parquet")
            written += make(order, shard)["bytes"]
        seconds = (time.process_time() - start) / args.shards
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    rate, each = size / seconds, written / (args.shards * size)
    print(f"a worker's start: {solving:.1f} s of CPU; a shard of {size:,} pairs: {seconds:.2f} s, {rate:,.0f} pairs/s")
    print(f"{each:.0f} bytes a pair on disk; peak {memory:.0f} MiB")
    print(f"{args.pairs:,} pairs: {args.pairs / rate / 3600:.1f} core hours, {args.pairs * each / 1e9:,.0f} GB")


if __name__ == "__main__":
    main()
