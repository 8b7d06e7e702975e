"""The demo answers over HTTP within its bounds, and a browser can plan with it."""

from __future__ import annotations

import json
import threading
import urllib.error
import urllib.request
from typing import TYPE_CHECKING, Any

import pytest

torch = pytest.importorskip("torch")
torch.set_num_threads(1)

from transformers import GPT2Config, GPT2LMHeadModel  # noqa: E402

from browser import Browser  # noqa: E402
from strips_lm import _native  # noqa: E402
from strips_lm.config import ConfigError, RunConfig  # noqa: E402
from strips_lm.demo.server import MAX_BODY, make_server  # noqa: E402
from strips_lm.demo.service import Service  # noqa: E402
from strips_lm.demo.watch import WatchedPlanner  # noqa: E402
from strips_lm.sources import built_in_domains, read_sources  # noqa: E402
from strips_lm.tokenizer import CanonicalTokenizer  # noqa: E402

if TYPE_CHECKING:
    from collections.abc import Iterator

DOMAIN = read_sources("manipulation").texts["domain.pddl"]


@pytest.fixture(scope="module")
def service() -> Service:
    """An untrained model on canonical words: what it writes is nonsense, unless the oracle guides it."""
    tokenizer = CanonicalTokenizer(_native.CanonicalCodec(_native.Domain.parse(DOMAIN)), 24)
    torch.manual_seed(0)
    sizes = {"n_positions": 384, "n_embd": 32, "n_layer": 2, "n_head": 2}
    model = GPT2LMHeadModel(GPT2Config(vocab_size=tokenizer.vocab_size, **sizes)).eval()
    config = RunConfig.load(None, ["generate.max_new=150", "generate.search_calls=300"])
    return Service(WatchedPlanner(model, tokenizer, config.generate), "untrained", seconds=20)


@pytest.fixture(scope="module")
def address(service: Service) -> Iterator[str]:
    with make_server(service, "127.0.0.1", 0) as server:
        thread = threading.Thread(target=server.serve_forever, daemon=True)
        thread.start()
        yield f"http://127.0.0.1:{server.server_address[1]}"
        server.shutdown()
        thread.join()


def ask(url: str, body: Any = None, **headers: str) -> tuple[int, str]:
    data = None if body is None else body if isinstance(body, bytes) else json.dumps(body).encode()
    headers = {"Content-Type": "application/json", **headers}
    request = urllib.request.Request(url, data, headers)
    try:
        with urllib.request.urlopen(request, timeout=60) as answer:
            return answer.status, answer.read().decode()
    except urllib.error.HTTPError as error:
        with error:
            return error.code, error.read().decode()


def solve(address: str, problem: str, decode: str) -> list[dict[str, Any]]:
    status, text = ask(f"{address}/solve", {"domain": DOMAIN, "problem": problem, "decode": decode})
    assert status == 200
    return [json.loads(line) for line in text.splitlines()]


@pytest.fixture(scope="module")
def problem(service: Service) -> str:
    return str(service.example("manipulation", 0)["problem"])


def test_every_built_in_domain_has_problems_that_can_be_read(service: Service) -> None:
    for name in built_in_domains():
        text = read_sources(name).texts["domain.pddl"]
        first, second = (service.example(name, number)["problem"] for number in (0, 17))
        assert first != second
        found = service.read(text, first)
        assert found["init"]
        assert found["goal"]


def test_the_parts_make_the_problem_again(service: Service, problem: str) -> None:
    found = service.read(DOMAIN, problem)
    objects = " ".join(f"{name} - {kind}" for name, kind in found["objects"])
    again = (
        f"(define (problem {found['name']}) (:domain {found['domain']}) (:objects {objects}) "
        f"(:init {' '.join(found['init'])}) (:goal (and {' '.join(found['goal'])})))"
    )
    assert service.read(DOMAIN, again) == found


@pytest.mark.parametrize("decode", ["search", "masked", "masked-replan"])
def test_a_plan_comes_step_by_step_with_the_verdict_and_the_oracle(address: str, problem: str, decode: str) -> None:
    events = solve(address, problem, decode)
    assert [event["event"] for event in events if event["event"] != "steps"] == ["asked", "answer", "oracle"]
    answer, oracle = events[-2:]
    assert answer["valid"]
    written = [[step["operator"] for step in event["steps"]] for event in events if event["event"] == "steps"]
    plan = [step["operator"] for step in answer["steps"]]
    assert len(written[0]) <= 1
    assert any(seen and seen == plan[: len(seen)] for seen in written), "steps are seen before the plan is whole"
    assert all(step["applies"] and step["state_right"] and 0 < step["probability"] < 1 for step in answer["steps"])
    assert len(oracle["shortest"]) <= len(answer["steps"])
    assert sum(map(int, oracle["counts"])) == int(oracle["open"][0])
    counts = list(map(int, oracle["open"]))
    assert counts == sorted(counts, reverse=True), "a step closes plans and opens none"


def test_a_wrong_plan_is_not_called_valid(address: str, problem: str) -> None:
    answer = solve(address, problem, "greedy")[-2]
    assert answer["event"] == "answer"
    assert not answer["valid"]
    assert answer["reason"]


def test_a_mistake_is_shown_with_line_and_caret(address: str, problem: str) -> None:
    _, text = ask(f"{address}/read", {"domain": DOMAIN, "problem": problem.replace("(on ", "(onn ", 1)})
    error = json.loads(text)["error"]
    assert "problem.pddl:" in error
    assert "^" in error
    assert "on" in error
    events = solve(address, problem.replace("(on ", "(onn ", 1), "greedy")
    assert events == [{"event": "error", "error": error}]


def test_an_unknown_way_of_decoding_is_said(address: str, problem: str) -> None:
    assert "did you mean `greedy`" in solve(address, problem, "gredy")[-1]["error"]


def test_a_model_that_takes_too_long_is_stopped(service: Service, problem: str) -> None:
    hasty = Service(service.planner, "hasty", seconds=1e-9)
    asked: list[dict[str, Any]] = []
    with pytest.raises(ConfigError, match="stopped after"):
        hasty.solve(DOMAIN, problem, "greedy", asked.append)
    assert not any(event["event"] == "answer" for event in asked)


def test_only_small_json_from_this_machine_is_taken(address: str) -> None:
    body = {"domain": DOMAIN, "problem": ""}
    assert ask(f"{address}/read", body, Host="evil.example")[0] == 403
    assert ask(f"{address}/", None, Host="evil.example")[0] == 403
    assert ask(f"{address}/read", body, **{"Content-Type": "text/plain"})[0] == 415
    assert ask(f"{address}/read", b"x" * (MAX_BODY + 1))[0] == 413
    assert ask(f"{address}/read", b"[" * 100_000)[0] == 400
    assert ask(f"{address}/read", {"domain": 3, "problem": 4})[0] == 400
    assert ask(f"{address}/../pyproject.toml")[0] == 404
    assert ask(f"{address}/example?domain=manipulation&number=x")[0] == 400
    assert "no domain" in ask(f"{address}/example?domain=../..&number=1")[1]


def test_an_address_that_is_taken_is_said_so(service: Service, address: str) -> None:
    for port in (int(address.rpartition(":")[2]), 70_000):
        with pytest.raises(ConfigError, match="cannot listen"):
            make_server(service, "127.0.0.1", port)


def test_the_page_loads_nothing_from_elsewhere(address: str) -> None:
    for name in ("/", "/demo.js", "/demo.css"):
        status, text = ask(address + name)
        assert status == 200
        assert "://" not in text


@pytest.mark.parametrize("width", [360, 1280])
def test_a_person_plans_in_a_browser(address: str, tmp_path: Any, width: int) -> None:
    with Browser(tmp_path, width) as browser:
        browser.open(f"{address}/")
        browser.wait("document.body.dataset.ready")
        assert browser.run("document.getElementById('domain').value") == "manipulation"
        assert browser.run("document.documentElement.scrollWidth") <= width
        before = browser.run("document.querySelectorAll('#objects .chip').length")
        browser.run("(document.getElementById('object-name').value = 'samovar')")
        browser.run("document.querySelector('#add-object button').click()")
        browser.wait(f"document.querySelectorAll('#objects .chip').length === {before + 1}")
        assert "samovar" in browser.run("document.getElementById('problem-text').value")
        browser.run("(document.getElementById('decode').value = 'search')")
        browser.run("document.getElementById('solve').click()")
        browser.wait("document.querySelector('#oracle li')")
        assert "✓ valid" in browser.run("document.getElementById('verdict').innerText")
        assert browser.run("document.querySelectorAll('#plan li .bar').length") > 0
        assert browser.run("document.documentElement.scrollWidth") <= width
        browser.run("(document.getElementById('problem-text').value = '(define (problem p)')")
        browser.run("document.getElementById('problem-text').dispatchEvent(new Event('input'))")
        browser.wait("!document.getElementById('error').hidden")
        assert "^" in browser.run("document.getElementById('error').textContent")
