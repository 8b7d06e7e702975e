"""Changes that say what they are to the goal: held against the texts, read slowly, and against what is left to do."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import pyarrow.parquet as pq
import pytest

from strips_lm.cli import main
from strips_lm.tokenizer.canonical import CanonicalTokenizer

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

SMALL = [
    "--pairs=150",
    "--seed=4",
    "--set=data.suite_records=20",
    "--set=data.problems_per_template=8",
    "--set=data.random_problems=60",
    "--set=data.states_per_start=150",
]
SIGN = re.compile(r"(toward|away)?([+-])(\w+)")


@pytest.fixture(scope="module")
def rows(tmp_path_factory: pytest.TempPathFactory) -> tuple[CanonicalTokenizer, list[dict]]:
    out: Path = tmp_path_factory.mktemp("data") / "set"
    assert main(["gen-data", f"--out={out}", *SMALL]) == 0
    return CanonicalTokenizer.of_data(out, 32, "progress"), pq.read_table(out / "data").to_pylist()


def atoms(text: str) -> list[str]:
    """The literals of a list, as they stand there."""
    return re.findall(r"(?:not )?[\w-]+\([^()]*\)", text)


def said(tokenizer: CanonicalTokenizer, ids: list[int], names: list[str]) -> Iterator[list[tuple[str, str, str]]]:
    """Of each state its changes: what they are to the goal, the sign and the atom as the text writes it."""
    for segment in " ".join(tokenizer.words[i] for i in ids).split("<STATE>")[1:]:
        changes: list[tuple[str, str, str]] = []
        for word in re.split(r"<ACTION>|<\|endoftext\|>", segment)[0].split():
            found = SIGN.fullmatch(word)
            if found:
                changes.append((found[1] or "", found[2], f"{found[3]}("))
            else:
                mark, sign, atom = changes[-1]
                changes[-1] = (mark, sign, atom + ("" if atom[-1] == "(" else ", ") + names[int(word[1:])])
        yield [(mark, sign, f"{atom})") for mark, sign, atom in changes]


def test_a_change_leads_to_the_goal_where_the_goal_has_it_so(rows: tuple[CanonicalTokenizer, list[dict]]) -> None:
    tokenizer, table = rows
    told, wholes = 0, 0
    for row in table:
        _, (ids,), (legend,) = tokenizer.encode_records([row["prompt"]], [row["completion"]], [row["words"]])
        goal = set(atoms(row["prompt"].split("<GOAL>")[1].split("<INIT>")[0]))
        state = set(atoms(row["prompt"].split("<INIT>")[1]))
        whole = row["goal_style"] == "state"
        left = len(goal ^ state) if whole else None
        for text, changes in zip(
            row["completion"].split("<STATE>")[1:], said(tokenizer, ids.tolist(), legend.names), strict=True
        ):
            state_after = set(atoms(re.split("<ACTION>|<.endoftext.>", text)[0]))
            assert {atom for _, sign, atom in changes if sign == "+"} == state_after - state
            assert {atom for _, sign, atom in changes if sign == "-"} == state - state_after
            for mark, sign, atom in changes:
                wanted = atom in goal or (False if whole or f"not {atom}" in goal else None)
                assert mark == ("" if wanted is None else "toward" if wanted == (sign == "+") else "away")
                told += bool(mark)
            state = state_after
            if left is not None:
                marks = [mark for mark, _, _ in changes]
                left += marks.count("away") - marks.count("toward")
                assert left == len(goal ^ state)
        assert not left
        wholes += whole
    assert told > 300
    assert 0.2 < wholes / len(table) < 0.8
