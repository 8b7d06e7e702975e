"""The command line's contract: what it prints, where, and with which exit code."""

from __future__ import annotations

import json
import os
import resource
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from strips_lm.cli import COMMANDS

SHORTEST = "(pick red table)\n(put red shelf)\n"


def test_count_is_one_json_object_with_exact_decimal_strings(cli, cups):
    result = cli("plans", *cups.args(), "--max-steps", 4, "--count")
    assert (result.code, result.err) == (0, "")
    assert json.loads(result.out) == {
        "max_steps": 4,
        "semantics": "first-goal",
        "counts": ["0", "0", "1", "0", "3"],
        "total": "4",
    }


def test_plans_are_blocks_separated_by_blank_lines(cli, cups):
    result = cli("plans", *cups.args(), "--max-steps", 4)
    blocks = result.out.split("\n\n")
    assert result.code == 0
    assert len(blocks) == 4
    assert blocks[0] == "; first-goal plans of at most 4 steps\n" + SHORTEST.rstrip("\n")


def test_printed_plans_are_valid_one_and_all(cli, cups, tmp_path):
    file = tmp_path / "all.plans"
    assert cli("plans", *cups.args(), "--max-steps", 5, "--semantics", "any", "--output", file).code == 0
    result = cli("validate", *cups.args(), file, "--many", "--json")
    verdicts = [json.loads(line)["verdict"] for line in result.out.splitlines()]
    count = json.loads(cli("plans", *cups.args(), "--max-steps", 5, "--semantics", "any", "--count").out)
    assert (result.code, set(verdicts), len(verdicts)) == (0, {"valid"}, int(count["total"]))


def test_the_empty_plan_survives_printing_and_validation(cli, cups, tmp_path):
    cups.problem.write_text(cups.problem.read_text().replace("(:goal (at red shelf))", "(:goal (at red table))"))
    file = tmp_path / "all.plans"
    assert cli("plans", *cups.args(), "--max-steps", 3, "--output", file).code == 0
    result = cli("validate", *cups.args(), file, "--many")
    assert (result.code, len(result.out.splitlines())) == (0, 1)


def test_a_sample_depends_on_its_seed_alone(cli, cups):
    draws = [cli("plans", *cups.args(), "--sample", 20, "--seed", seed).out for seed in (1, 1, 2)]
    assert draws[0] == draws[1] != draws[2]


def test_a_distinct_sample_of_all_plans_is_all_plans(cli, cups):
    everything = cli("plans", *cups.args(), "--max-steps", 4).out
    sample = cli("plans", *cups.args(), "--max-steps", 4, "--sample", 4, "--distinct").out
    strip = lambda text: sorted(block.strip() for block in text.partition("\n")[2].split("\n\n"))  # noqa: E731
    assert strip(sample) == strip(everything)


def test_shortest_and_limit_print_no_more_than_asked(cli, cups):
    assert cli("plans", *cups.args(), "--shortest").out.partition("\n")[2] == SHORTEST
    limited = cli("plans", *cups.args(), "--limit", 2)
    assert len(limited.out.split("\n\n")) == 2
    assert "stopped after 2 of" in limited.err


def test_no_plan_is_exit_1_but_a_count_of_zero_is_an_answer(cli, cups):
    assert cli("plans", *cups.args(), "--max-steps", 1).code == 1
    assert cli("plans", *cups.args(), "--max-steps", 1, "--count").code == 0


@pytest.mark.parametrize(
    ("plan", "verdict", "step", "missing"),
    [
        ("; comment\n0.0: (PICK red TABLE) [1]\r\n(put red shelf)\r\n", "valid", None, []),
        ("(pick red table)\n(pick blue table)\n", "inapplicable", 2, ["(not (busy))"]),
        ("(pick red table)\n", "goal_not_reached", 2, ["(at red shelf)"]),
        ("(lift red table)\n", "unknown_action", 1, []),
        ("(pick green table)\n", "unknown_object", 1, []),
        ("(pick red)\n", "arity", 1, []),
        ("(pick table red)\n", "type", 1, []),
        ("(pick red table\n", "syntax", None, []),
    ],
)
def test_validate_says_what_fails_and_where(cli, cups, tmp_path, plan, verdict, step, missing):
    file = tmp_path / "my.plan"
    file.write_text(plan, newline="")
    result = cli("validate", *cups.args(), file, "--json")
    answer = json.loads(result.out)
    assert result.code == (0 if verdict == "valid" else 1)
    assert list(answer) == ["plan", "verdict", "step", "line", "missing", "reason"]
    assert (answer["plan"], answer["verdict"], answer["missing"]) == (str(file), verdict, missing)
    assert answer["step"] == step or verdict == "syntax"


def test_lines_of_many_plans_count_from_the_top_of_the_file(cli, cups, tmp_path):
    file = tmp_path / "many.plans"
    file.write_text(f"; notes alone are no plan\n\n{SHORTEST}\n\n; the second\n(pick red table)\n(pick red table)\n")
    first, second = cli("validate", *cups.args(), file, "--many", "--json").out.splitlines()
    assert json.loads(first)["verdict"] == "valid"
    assert (json.loads(second)["step"], json.loads(second)["line"]) == (2, 9)


def test_val_output_has_the_words_that_tools_look_for(cli, cups, tmp_path):
    good, bad = tmp_path / "good.plan", tmp_path / "bad.plan"
    good.write_text(SHORTEST)
    bad.write_text("(pick red table)\n")
    result = cli("validate", *cups.args(), good, bad, "--val")
    assert result.code == 1
    assert result.out == (
        f"Checking plan: {good}\nPlan executed successfully - checking goal\nPlan valid\nFinal value: 2 \n"
        f"Checking plan: {bad}\nPlan executed successfully - checking goal\nGoal not satisfied\nPlan invalid\n"
        f"\nSuccessful plans:\nValue: 2\n {good} \n\n\nFailed plans:\n {bad} \n"
    )


def test_bad_pddl_is_exit_2_with_place_caret_and_suggestion(cli, cups):
    cups.problem.write_text(cups.problem.read_text().replace("(:goal (at red shelf))", "(:goal (att red shelf))"))
    result = cli("plans", *cups.args())
    assert (result.code, result.out) == (2, "")
    assert f"{cups.problem}:5:11:" in result.err
    assert "^^^" in result.err
    assert "did you mean `at`" in result.err
    assert "Traceback" not in result.err


@pytest.mark.parametrize(
    "argv",
    [
        [],
        ["plan"],
        ["plans"],
        ["plans", "a.pddl", "b.pddl", "--max-steps", "-1"],
        ["plans", "a.pddl", "b.pddl", "--count", "--shortest"],
        ["plans", "missing.pddl", "missing.pddl"],
    ],
)
def test_bad_usage_is_exit_2_and_one_error(cli, argv):
    result = cli(*argv)
    assert (result.code, result.out) == (2, "")
    assert result.err.startswith("error: ")
    assert "Traceback" not in result.err


def test_a_limit_is_exit_3(cli, cups):
    result = cli("plans", *cups.args(), "--max-steps", 5, "--time-limit", 0)
    assert result.code == 3
    assert result.err.startswith("error: ")


@pytest.mark.parametrize("argv", [["--help"], ["--version"], *([name, "--help"] for name in COMMANDS)])
def test_help_is_an_answer(cli, argv):
    result = cli(*argv)
    assert (result.code, result.err) == (0, "")
    assert result.out


def test_a_reader_that_leaves_is_no_error(cups):
    command = f"{sys.executable} -m strips_lm plans {cups.domain} {cups.problem} --max-steps 12 | head -n 1"
    done = subprocess.run(["bash", "-o", "pipefail", "-c", command], capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stderr) == (0, "")


def test_ctrl_c_is_answered_at_once_with_exit_130(tmp_path):
    domain, problem = tmp_path / "d.pddl", tmp_path / "p.pddl"
    domain.write_text(
        "(define (domain bits) (:requirements :adl) (:predicates (on ?x)) (:action flip :parameters (?x)"
        " :effect (and (when (on ?x) (not (on ?x))) (when (not (on ?x)) (on ?x)))))"
    )
    switches = " ".join(f"s{i}" for i in range(40))
    problem.write_text(
        "(define (problem p) (:domain bits) (:requirements :adl) (:init)"
        f" (:objects {switches}) (:goal (forall (?x) (on ?x))))"
    )
    command = [sys.executable, "-m", "strips_lm", "plans", str(domain), str(problem), "--max-steps", "60", "--count"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    time.sleep(1.0)
    assert process.poll() is None, "too quick to interrupt"
    process.send_signal(signal.SIGINT)
    sent = time.perf_counter()
    out, err = process.communicate(timeout=30)
    assert time.perf_counter() - sent < 2, "200 ms on a quiet machine; tests run beside each other"
    assert (process.returncode, out, err) == (130, "", "interrupted\n")


@pytest.mark.parametrize(
    "argv", [["--help"], ["plans", "DOMAIN", "PROBLEM", "--count"], ["validate", "--help"], ["gen-data", "--help"]]
)
def test_the_oracle_answers_in_300_ms_without_importing_torch(cups, argv):
    argv = [{"DOMAIN": str(cups.domain), "PROBLEM": str(cups.problem)}.get(arg, arg) for arg in argv]
    code = f"import sys; from strips_lm.cli import main; main({argv!r}); sys.exit('torch' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True).returncode == 0
    assert min(cpu_seconds(argv) for _ in range(5)) < 0.3, "processor time, which other processes do not lengthen"


def cpu_seconds(argv: list[str]) -> float:
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([sys.executable, "-m", "strips_lm", *argv], capture_output=True, check=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def test_readme_shows_the_two_commands():
    readme = (Path(__file__).parents[1] / "README.md").read_text()
    assert "python3 -m pip install uv && uv run strips-lm quickstart" in readme
    assert "python3 -m pip install uv && uv run pytest" in readme
    assert os.access(Path(__file__).parents[1] / ".ci" / "run", os.X_OK)


def test_an_unknown_field_is_named_with_the_file_it_stands_in(cli, tmp_path):
    preset = tmp_path / "mine.toml"
    preset.write_text("[train]\nstep = 3\n")
    result = cli("train", tmp_path, "--out", tmp_path / "run", "--preset", preset)
    assert result.code == 2
    assert f"{preset}: no field `train.step`\nhint: did you mean `steps`?" in result.err
    assert "mine.toml" not in cli("train", tmp_path, "--out", tmp_path / "run", "--set", "train.step=3").err
