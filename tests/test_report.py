"""The page stands alone, is well formed, and a browser can draw it."""

from __future__ import annotations

import json
import re
from html.parser import HTMLParser
from typing import TYPE_CHECKING

import pytest

pytest.importorskip("matplotlib")

from browser import Browser
from fixture_results import PLAN, made_up_results
from strips_lm.cli import main
from strips_lm.report import charts, page
from strips_lm.report.graph import StateGraph, draw, walk

if TYPE_CHECKING:
    from pathlib import Path

VOID = {"meta", "br", "wbr", "link", "img", "input", "hr"}


class Balance(HTMLParser):
    """Fails where a tag is closed that was not opened last."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []

    def handle_starttag(self, tag: str, _attrs: object) -> None:
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


@pytest.fixture(scope="module")
def html(tmp_path_factory: pytest.TempPathFactory) -> str:
    return page(made_up_results(tmp_path_factory.mktemp("results")))


def test_every_tag_is_closed(html: str) -> None:
    balance = Balance()
    balance.feed(html)
    assert balance.open == []


def test_the_page_asks_for_nothing_from_outside(html: str) -> None:
    assert "<script" not in html
    assert not re.findall(r'(?:src|href)="(?!#)[^"]*"', html)
    assert "@import" not in html
    assert not re.search(r"url\((?!#)", html)


def test_every_figure_is_there(html: str) -> None:
    for key in ("table", "suites", "decoding", "lengths", "failures", "steps", "training", "problems", "examples"):
        assert html.count(f'<section id="{key}">') == 1
        assert f'href="#{key}"' in html
    assert html.count('class="chart"') == 2 * 6, "each chart for a wide page and for a telephone"
    assert html.count('class="graph"') == 1


def test_what_was_decoded_with_help_stands_apart(html: str) -> None:
    table = html[html.index('<section id="table">') : html.index('<section id="suites">')]
    free, helped = table.split("With the oracle's help")
    assert "best-of-8 by oracle" in helped
    assert "best-of-8 by oracle" not in free
    assert free.count("greedy") == 2


def test_losses_stand_over_their_floor(html: str) -> None:
    assert html[html.index('<section id="training">') :].count(">floor</text>") == 2


def test_each_step_has_its_probability(html: str) -> None:
    problems = html[html.index('<section id="problems">') : html.index('<section id="examples">')]
    for number, operator in enumerate(PLAN.split("\n")):
        assert f"<code>{operator}</code>" in problems
        assert f"width:{99 - 10 * number}.0%" in problems


def test_results_without_probabilities_can_be_shown(tmp_path: Path) -> None:
    from strips_lm.evaluate.results import Results

    path = tmp_path / "results.json"
    made_up_results(tmp_path).save(path)
    old = json.loads(path.read_text())
    for output in old["examples"][0]["outputs"]:
        for name in ("operator_probabilities", "state_probabilities", "end_probability"):
            del output[name]
    path.write_text(json.dumps(old))
    assert 'class="bar"' not in page(Results.load(path))


def test_drawings_share_no_id_and_no_fixed_colour(html: str) -> None:
    ids = re.findall(r'\bid="([^"]*)"', html)
    assert len(ids) == len(set(ids))
    assert "var(--ink)" in html
    assert not re.search(r"#0000[0-9a-f]{2}\b", html)


def test_more_series_than_colours_are_told_apart_by_shape() -> None:
    def shapes(count: int) -> int:
        series = {f"way {i}": [charts.Share(50.0, 40.0, 60.0)] for i in range(count)}
        drawn = charts.shares(["suite"], series, "% valid", "title")
        return len(set(re.findall(r'<path id="[^"]+" d="([^"]+)"', drawn)))

    assert shapes(9) == shapes(8) + 1


def test_the_same_results_give_the_same_page(tmp_path: Path) -> None:
    results = made_up_results(tmp_path)
    assert page(results) == page(results)


def test_a_model_text_is_escaped(tmp_path: Path) -> None:
    from dataclasses import replace

    results = made_up_results(tmp_path)
    outputs = results.examples[0].outputs
    outputs[0] = replace(outputs[0], text="<ACTION> <b>bold</b>(cup) <script>alert(1)</script>")
    found = page(results)
    assert "<script" not in found
    assert "<b>bold" not in found


def test_the_plan_is_a_path_of_the_graph() -> None:
    graph = StateGraph([["(a)"], ["(b)"], ["(c)"]], [0, 1, 2], [False, False, True], [(0, 1, "(x)"), (1, 2, "(y)")])
    assert walk(graph, ["(x)", "(y)"]) == [0, 1, 2]
    assert walk(graph, ["(x)", "(z)"]) == [0, 1]
    assert draw(graph, ["(x)", "(y)"]).count('class="path"') == 2
    assert 'class="cross"' not in draw(graph, ["(x)", "(y)"])
    assert draw(graph, ["(x)", "(z)"]).count('class="cross"') == 1, "the second step leads out of the graph"
    assert draw(graph, [], ["(x)", "(y)"]).count('class="oracle"') == 2


def test_the_state_graph_has_the_plan(html: str) -> None:
    assert html.count('class="path"') == len(PLAN.split("\n"))
    assert html.count('class="oracle"') == len(PLAN.split("\n"))


def test_the_command_joins_runs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    made_up_results(tmp_path / "a").save(tmp_path / "a" / "results.json")
    assert main(["report", str(tmp_path / "a"), "--out", str(tmp_path / "page.html")]) == 0
    assert (tmp_path / "page.html").read_text(encoding="utf-8").startswith("<!doctype html>")
    assert "page.html" in capsys.readouterr().out


@pytest.mark.parametrize("width", [360, 1280])
def test_a_browser_draws_it(tmp_path: Path, html: str, width: int) -> None:
    """Light and dark differ, nothing is wider than the page, and the chart that fits is the one that is seen."""
    (tmp_path / "report.html").write_text(html, encoding="utf-8")
    with Browser(tmp_path, width) as browser:
        browser.open((tmp_path / "report.html").as_uri())
        assert browser.run("document.documentElement.scrollWidth") <= width
        seen = "[...document.querySelectorAll('svg.chart')].filter(c => c.getBoundingClientRect().width > 0).length"
        assert browser.run(seen) == 6
        drawn = {}
        for scheme in ("light", "dark"):
            browser.prefer(scheme)
            drawn[scheme] = browser.screenshot()
            assert len(drawn[scheme]) > 20_000
        assert drawn["light"] != drawn["dark"]
