"""What a person sees of a plan on a terminal: every step, every change, and colours only where they are wanted."""

from __future__ import annotations

import sys
from importlib.resources import files

import pytest

pytest.importorskip("rich")

from fixture_results import PROBLEM, PROMPT, TEXT
from strips_lm import _native
from strips_lm.cli import plan_view
from strips_lm.trace import literals, trace

COLOUR = "\x1b[3"


@pytest.fixture
def shown(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch):
    """What `show` prints on a terminal."""
    domain = _native.Domain.parse((files("strips_lm") / "domains/manipulation/domain.pddl").read_bytes())
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True, raising=False)
    monkeypatch.setenv("TERM", "xterm-256color")
    monkeypatch.setenv("COLUMNS", "100")
    monkeypatch.delenv("NO_COLOR", raising=False)

    def show(text: str = TEXT, *, states: bool = False, **environment: str) -> str:
        for name, value in environment.items():
            monkeypatch.setenv(name, value)
        words = {name: name for name, _ in domain.actions}
        judgement = _native.judge(domain, [PROBLEM], [text], [words])[0]
        plan_view.show(trace(PROMPT, text), judgement, judgement.verdict.reason, valid=False, states=states)
        return capsys.readouterr().out

    return show


def test_every_step_comes_with_what_it_changes(shown) -> None:
    out = shown(NO_COLOR="1").replace("\N{NO-BREAK SPACE}", " ")
    order = [
        "goal",
        "start",
        "(pick cup)",
        "+ inhand(cup)",
        "- on(cup, shelf)",
        "(place cup table)",
        "+ on(cup, table)",
    ]
    places = [out.index(part) for part in order]
    assert places == sorted(places)
    assert "the goal is not reached" in " ".join(out.split())


def test_colours_are_off_where_they_are_not_wanted(shown) -> None:
    assert COLOUR in shown(FORCE_COLOR="1")
    assert COLOUR not in shown(NO_COLOR="1")


def test_states_are_whole_when_asked_for(shown) -> None:
    out = " ".join(shown(states=True, NO_COLOR="1").split())
    assert "inhand(cup), inworkspace(table), inworkspace(teabag), inworkspace(cup), on(teabag, shelf)" in out


def test_a_wrong_state_is_pointed_out(shown) -> None:
    lie = TEXT.replace("<STATE> inhand(cup), ", "<STATE> ", 1)
    assert "this state is not the true one" in shown(lie, NO_COLOR="1")
    assert "this state is not the true one" not in shown(NO_COLOR="1")


def test_changes_add_up_to_the_states() -> None:
    found = trace(PROMPT, TEXT)
    before = set(found.initial)
    for step in found.steps:
        before = before - set(step.removed) | set(step.added)
        assert before == set(step.state or ())


def test_negative_literals_of_a_goal_are_kept() -> None:
    assert literals("not opened(box), on(a, b), handempty()") == ("not opened(box)", "on(a, b)", "handempty()")
