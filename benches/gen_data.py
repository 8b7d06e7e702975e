"""Times `gen-data`: 71,128 pairs of the default domain, files and manifest included, beside a plain-Python twin.

The twin (`benches/plain`) does the same job: it reads the same PDDL, templates and lexicon, expands templates, draws
random problems, drops those that are equal up to names, finds shortest plans by breadth-first search, draws names and
words, replays every negative until one is proven wrong, and writes the texts to a file (JSON Lines). Neither makes
suites here. It is given a share of the problems and of the pairs, and its time is scaled up by that; reading and
expanding templates, which does not shrink, is counted once. Its records whose goal is literals are proven by
`gen-data`'s own prover, so that it is known to do the job.

Ratios are of CPU seconds, threads added up, which a busy machine hardly changes; wall-clock rates are printed too.

    python benches/gen_data.py [--pairs N] [--jobs N] [--share 20]
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import os
import resource
import tempfile
import time
from pathlib import Path
from typing import Any

from plain.planning import Domain as PlainDomain
from plain.problems import Template
from plain.records import Generator
from strips_lm._native import Domain, Prover
from strips_lm.config import RunConfig
from strips_lm.shards import write_data_set
from strips_lm.sources import DomainSources, read_sources


@dataclasses.dataclass
class Clock:
    """CPU and wall-clock seconds since it was made."""

    cpu: float = dataclasses.field(default_factory=time.process_time)
    wall: float = dataclasses.field(default_factory=time.perf_counter)

    def read(self) -> Clock:
        return Clock(time.process_time() - self.cpu, time.perf_counter() - self.wall)


def ours(config: RunConfig, sources: DomainSources, jobs: int) -> Clock:
    """What one data set takes."""
    with tempfile.TemporaryDirectory() as folder:
        clock = Clock()
        write_data_set(Path(folder) / "set", config, sources, jobs=jobs)
        spent = clock.read()
        files = [path for path in Path(folder).rglob("*") if path.is_file()]
        text = text_bytes([path for path in files if path.parent.name == "data"])
        size = sum(path.stat().st_size for path in files)
    print(f"gen-data: {config.data.pairs:,} pairs, {spent.cpu:.2f} s of CPU, {spent.wall:.2f} s by the clock", end="")
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(f"; {text / 1e6:.0f} MB of text, {size / 1e6:.1f} MB on disk, peak {memory:.0f} MiB")
    return spent


def text_bytes(shards: list[Path]) -> int:
    """The bytes of prompts, completions and negatives."""
    import pyarrow.compute as pc
    import pyarrow.parquet as pq

    columns = ("prompt", "completion", "negative")
    tables = (pq.read_table(path, columns=list(columns)) for path in shards)
    return sum(pc.sum(pc.binary_length(table[name])).as_py() for table in tables for name in columns)


def twin(config: RunConfig, sources: DomainSources, share: int) -> float:
    """CPU seconds that the plain twin would take for the whole, from one part in `share` of it."""
    data = dataclasses.replace(
        config.data,
        random_problems=config.data.random_problems // share,
        problems_per_template=config.data.problems_per_template // share,
    )
    clock = Clock()
    domain = PlainDomain(sources.texts["domain.pddl"])
    for name, text in sources.texts.items():
        if name.startswith("templates/") and Path(name).stem not in data.held_out_templates:
            list(Template(text, domain).expand())
    once = clock.read().cpu
    clock = Clock()
    generator = Generator(sources.texts, data)
    problems, pairs = clock.read().cpu - once, config.data.pairs // share
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "records.jsonl"
        clock = Clock()
        generator.write(path, pairs)
        records = clock.read().cpu
        proven = prove(generator, [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()], sources)
    whole = once + share * (problems + records)
    print(
        f"plain Python: {len(generator.problems):,} problems in {problems:.1f} s ({once:.1f} s for templates besides), "
        f"{pairs:,} pairs in {records:.1f} s, all CPU ({proven:,} of the pairs proven): {whole:.0f} s for the whole"
    )
    return whole


def prove(generator: Generator, rows: list[dict[str, Any]], sources: DomainSources) -> int:
    """How many records the oracle has proven; those whose goal is a whole state are left out.

    Raises:
        ValueError: one is wrong.
    """
    prover = Prover(
        Domain.parse(sources.texts["domain.pddl"], "domain.pddl"), list(map(generator.problem_text, generator.problems))
    )
    stated = [row for row in rows if row["goal_style"] == "problem"]
    for row, fault in zip(stated, prover.check(stated), strict=True):
        if fault:
            raise ValueError(f"the twin's record {row['index']}: {fault}")
    return len(stated)


def main() -> None:
    """Prints both, and how they compare."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pairs", type=int, default=71_128)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--share", type=int, default=20, help="the twin makes one part in so many")
    args = parser.parse_args()
    config = RunConfig.load(None, [f"data.pairs={args.pairs}", "data.suite_records=0"])
    sources = read_sources(config.data.domain)
    spent = ours(config, sources, args.jobs)
    plain = twin(config, sources, args.share)
    rates = f"{args.pairs / spent.cpu:,.0f} pairs against {args.pairs / plain:,.0f}"
    print(
        f"per CPU second {rates}: {plain / spent.cpu:.0f} times; by the clock, {args.jobs} threads against one "
        f"process, {plain / spent.wall:.0f} times (load {os.getloadavg()[0]:.1f})"
    )


if __name__ == "__main__":
    main()
