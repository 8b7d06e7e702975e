"""Every built-in domain gives a data set: its templates, lexicon and random problems are read and solved."""

from __future__ import annotations

import json
from importlib.resources import files

import pytest

DOMAINS = sorted(path.name for path in (files("strips_lm") / "domains").iterdir() if path.is_dir())


def test_the_eight_domains_are_there():
    assert DOMAINS == [
        "blocksworld",
        "driverlog",
        "ferry",
        "gripper",
        "hanoi",
        "logistics",
        "manipulation",
        "visitall",
    ]


@pytest.mark.parametrize("domain", DOMAINS)
def test_a_built_in_domain_makes_records_of_every_split(cli, tmp_path, domain):
    few = ["--set", "data.suite_records=20", "--set", "data.random_problems=200"]
    result = cli("gen-data", "--out", tmp_path, "--domain", domain, "--pairs", 120, *few)
    assert result.code == 0, result.err
    splits = json.loads((tmp_path / "manifest.json").read_text())["splits"]
    assert (splits["train"], splits["validation"]) == (100, 20)
    assert {"unseen-objects", "unseen-actions", "unseen-shapes", "longer"} <= set(splits)
    assert cli("verify-data", tmp_path).out == ""
    assert (files("strips_lm") / "domains" / domain / "README.md").is_file()
