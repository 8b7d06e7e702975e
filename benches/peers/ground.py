"""Parsing and grounding against the Fast Downward translator, on the same generated files, in one run, as ratios.

Needs a Rust toolchain, and the translator from PyPI: ``pip install fast-downward-translate`` (or
``up-fast-downward``, which carries it). Prints one JSON object a task to stdout and a table to stderr. Times are
processor time, so that a busy machine does not blur them: of our whole process (start, reading, parsing, grounding),
against the translator's own figures for its stages "Parsing" and "Instantiating" and against its whole process. The
fastest of ``--repeat`` runs counts.
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import re
import resource
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

TOP = Path(__file__).resolve().parents[2]
STAGES = re.compile(r"^(Parsing|Instantiating): \[([0-9.]+)s CPU", re.MULTILINE)
OPERATORS = re.compile(r"^Translator operators: ([0-9]+)", re.MULTILINE)


def run(command: list[str]) -> tuple[str, float]:
    """The command's standard output and its processor time in seconds."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    output = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return output, (after.ru_utime + after.ru_stime) - (before.ru_utime + before.ru_stime)


def ours(binary: Path, folder: Path) -> dict[str, float]:
    """Counts and seconds of this project's grounder."""
    output, process = run([str(binary), str(folder / "domain.pddl"), str(folder / "problem.pddl")])
    result: dict[str, float] = json.loads(output)
    return {**result, "process": process}


def translator(folder: Path) -> dict[str, float]:
    """Counts and seconds of the Fast Downward translator."""
    files = [str(folder / name) for name in ("domain.pddl", "problem.pddl")]
    command = [sys.executable, "-m", "fast_downward.translate", *files, "--sas-file", str(folder / "output.sas")]
    output, process = run(command)
    stages = sum(float(seconds) for _, seconds in STAGES.findall(output))
    found = OPERATORS.search(output)
    return {"operators": int(found.group(1)) if found else 0, "total": stages, "process": process}


def compare(binary: Path, folder: Path, repeat: int) -> dict[str, Any]:
    """One task's figures: the fastest of a few runs of each."""
    mine = min((ours(binary, folder) for _ in range(repeat)), key=lambda result: result["process"])
    peer = min((translator(folder) for _ in range(repeat)), key=lambda result: result["process"])
    return {
        "task": folder.name,
        "operators": mine["operators"],
        "peer_operators": peer["operators"],
        "seconds": mine["process"],
        "peer_stages_seconds": peer["total"],
        "peer_process_seconds": peer["process"],
        "ratio": peer["total"] / mine["process"],
        "process_ratio": peer["process"] / mine["process"],
    }


def report(row: dict[str, Any]) -> None:
    """One line of the table."""
    print(json.dumps(row), flush=True)
    print(
        f"{row['task']:<24}{row['operators']:>9} operators {row['seconds']:8.3f} s; translator: parse + instantiate "
        f"{row['peer_stages_seconds']:7.2f} s ({row['ratio']:.1f} x), whole {row['peer_process_seconds']:7.2f} s "
        f"({row['process_ratio']:.1f} x)",
        file=sys.stderr,
    )


def main() -> int:
    """Runs the comparison; 2 where the translator is not installed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeat", type=int, default=2, help="runs of each; the fastest counts")
    parser.add_argument("--task", help="only the tasks whose names contain this")
    options = parser.parse_args()
    if importlib.util.find_spec("fast_downward") is None:
        print("the translator is not installed\nhint: pip install fast-downward-translate", file=sys.stderr)
        return 2
    subprocess.run(["cargo", "build", "--release", "-q", "-p", "strips-bench", "--bin", "ground"], cwd=TOP, check=True)
    binary = TOP / "target" / "release" / "ground"
    with tempfile.TemporaryDirectory() as folder:
        names = run([str(binary), "write", folder])[0].split()
        for name in names:
            if options.task is None or options.task in name:
                report(compare(binary, Path(folder) / name, options.repeat))
    return 0


if __name__ == "__main__":
    sys.exit(main())
