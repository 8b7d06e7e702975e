"""Writes the first inputs of the fuzz targets, from the project's own PDDL, to `fuzz/corpus/TARGET/`.

    python fuzz/seeds.py && cargo +nightly fuzz run whole -- -max_total_time=600 -dict=fuzz/pddl.dict

Every domain and problem of `tests/data/` and of the built-in domains, right or wrong, is an input of its target;
`whole` gets both with a plan, a zero byte between, as its target splits them.
"""

from __future__ import annotations

import sys
from pathlib import Path

TOP = Path(__file__).resolve().parents[1]
KINDS = ("domain", "problem")
PLANS = (b"(pick a)\n(drop a)\n", b"0.000: (PICK-UP b1) [1.0]\r\n; comment\n(stack b1 b2)", b"", b"((a", b"(noop)")


def main() -> int:
    """Writes the inputs and says how many each target has."""
    domains = [*TOP.glob("tests/data/*/*/domain.pddl"), *TOP.glob("python/strips_lm/domains/*/domain.pddl")]
    pairs = [
        (domain.read_bytes(), problem.read_bytes())
        for domain in sorted(domains)
        for problem in sorted(domain.parent.rglob("*.pddl"))
        if problem.name != "domain.pddl"
    ]
    wrong = {kind: [path.read_bytes() for path in TOP.glob(f"tests/data/invalid/{kind}-*.pddl")] for kind in KINDS}
    inputs = {
        "domain": [domain for domain, _ in pairs] + wrong["domain"],
        "problem": [problem for _, problem in pairs] + wrong["problem"],
        "plan": list(PLANS),
        "whole": [b"\0".join((*pair, plan)) for pair in pairs for plan in PLANS],
    }
    for target, texts in inputs.items():
        folder = TOP / "fuzz/corpus" / target
        folder.mkdir(parents=True, exist_ok=True)
        unique = sorted(set(texts))
        for number, text in enumerate(unique):
            (folder / f"seed-{number:03}").write_bytes(text)
        print(f"{target}: {len(unique)} inputs")
    return 0


if __name__ == "__main__":
    sys.exit(main())
