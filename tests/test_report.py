"""The page stands alone, is well formed, and a browser can draw it."""

from __future__ import annotations

import re
import shutil
import subprocess
from html.parser import HTMLParser
from typing import TYPE_CHECKING

import pytest

pytest.importorskip("matplotlib")

from fixture_results import PLAN, made_up_results
from strips_lm.cli import main
from strips_lm.report import page
from strips_lm.report.graph import StateGraph, draw, walk

if TYPE_CHECKING:
    from pathlib import Path

VOID = {"meta", "br", "link", "img", "input", "hr"}


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
    for title in ("Table 1", "Valid plans by suite", "Training", "state graph", "What the models wrote", "Where plans"):
        assert title in html
    assert html.count('class="chart"') == 4
    assert html.count("<svg") == 5


def test_drawings_share_no_id_and_no_fixed_colour(html: str) -> None:
    ids = re.findall(r'\bid="([^"]*)"', html)
    assert len(ids) == len(set(ids))
    assert "var(--ink)" in html
    assert not re.search(r"#0000[0-9a-f]{2}\b", html)


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


def test_the_state_graph_has_the_plan(html: str) -> None:
    assert html.count('class="path"') == len(PLAN.split("\n"))


def test_the_command_joins_runs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    made_up_results(tmp_path / "a").save(tmp_path / "a" / "results.json")
    assert main(["report", str(tmp_path / "a"), "--out", str(tmp_path / "page.html")]) == 0
    assert (tmp_path / "page.html").read_text(encoding="utf-8").startswith("<!doctype html>")
    assert "page.html" in capsys.readouterr().out


@pytest.mark.skipif(shutil.which("chromium") is None, reason="no chromium on this machine")
def test_a_browser_draws_it(tmp_path: Path, html: str) -> None:
    (tmp_path / "report.html").write_text(html, encoding="utf-8")
    picture = tmp_path / "report.png"
    options = ["--headless", "--no-sandbox", "--disable-gpu", "--window-size=500,1500", f"--screenshot={picture}"]
    subprocess.run(
        ["chromium", *options, f"file://{tmp_path}/report.html"], check=True, capture_output=True, timeout=120
    )
    assert picture.stat().st_size > 20_000
