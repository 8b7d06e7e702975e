"""Problems that are grounded once judge the same as problems that are grounded for each text."""

from __future__ import annotations

from importlib.resources import files

import pytest

from fixture_results import PROBLEM, TEXT
from strips_lm import _native

OTHER = PROBLEM.replace("(and (on teabag cup) (on cup table) (opened cup))", "(on cup table)")


def test_a_judge_says_what_judging_one_by_one_says() -> None:
    domain = _native.Domain.parse((files("strips_lm") / "domains/manipulation/domain.pddl").read_bytes())
    words = {name: name for name, _ in domain.actions}
    judge = _native.Judge(domain, [PROBLEM, OTHER], [words, words])
    assert len(judge) == 2
    numbers, texts = [1, 0, 1, 0], [TEXT, TEXT, "<ACTION> nonsense", "<ACTION> nonsense"]
    alone = _native.judge(domain, [(PROBLEM, OTHER)[n] for n in numbers], texts, [words] * 4)
    for _ in range(2):
        found = judge.judge(numbers, texts)
        assert [(j.verdict, j.plan, j.states_right) for j in found] == [
            (j.verdict, j.plan, j.states_right) for j in alone
        ]
    assert [j.verdict.is_valid for j in found] == [True, False, False, False]


def test_what_a_judge_cannot_take() -> None:
    domain = _native.Domain.parse((files("strips_lm") / "domains/manipulation/domain.pddl").read_bytes())
    with pytest.raises(ValueError, match="1 problems and 2 word lists"):
        _native.Judge(domain, [PROBLEM], [{}, {}])
    judge = _native.Judge(domain, [PROBLEM], [{}])
    with pytest.raises(ValueError, match="1 numbers of problems for 2 texts"):
        judge.judge([0], ["", ""])
    with pytest.raises(IndexError, match="no problem 1, but 1"):
        judge.judge([1], [""])
    with pytest.raises(_native.PddlError):
        _native.Judge(domain, ["(define"], [{}])
