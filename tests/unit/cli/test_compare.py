"""`drive-robust compare`, in the process and from outside."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from stored_runs import store_run

from pytest_drive_robust.cli.main import main

pytestmark = pytest.mark.usefixtures("home")


def test_a_run_that_is_no_worse_exits_with_0(capsys: pytest.CaptureFixture[str]) -> None:
    store_run("a")
    store_run("b", factor=0.99)
    assert main(["compare", "a", "b"]) == 0
    shown = capsys.readouterr().out
    assert "no regression shown in 2 settings against a" in shown
    assert all(len(line) <= 100 for line in shown.splitlines() if "replay" not in line)


def test_a_regression_exits_with_1_and_shows_the_routes(capsys: pytest.CaptureFixture[str]) -> None:
    store_run("a")
    path = store_run("b", factor=0.5)
    assert main(["compare", "a", str(path)]) == 1
    shown = capsys.readouterr().out
    assert "REGRESSION: 1 of 2 settings against a: driver under 200 ms latency" in shown
    assert "broken: DS drops by 5 % at most; 74.00 -> 37.00 (-50.0 %) on 40 routes" in shown
    assert shown.count("newly going wrong: ") == 6
    assert "15 more newly going wrong" in shown
    assert 'replay:  drive-robust replay 1 --agent driver --setting "200 ms latency" --seed 0' in shown


def test_what_was_found_is_written_for_machines(tmp_path: Path) -> None:
    store_run("a")
    store_run("b", factor=0.5)
    file = tmp_path / "found.json"
    assert main(["compare", "a", "b", "--fail-on", "ds:-3%", "--json", str(file)]) == 1
    found = json.loads(file.read_text())
    assert (found["label"], found["regressed"], found["refused"]) == ("a", True, [])
    terms = {"fail_on": ["ds:-3%"], "verdict": "auto", "on_mismatch": "default", "inconclusive": "warn"}
    assert found["terms"] == terms
    assert found["conclusion"].startswith("REGRESSION: 1 of 2 settings against a")
    assert {cell["setting"]: cell["verdict"] for cell in found["cells"]} == {"clean": "pass", "200 ms latency": "fail"}


def test_an_empty_list_of_what_may_get_worse_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    store_run("a")
    store_run("b")
    assert main(["compare", "a", "b", "--fail-on", ","]) == 4
    assert "--fail-on is ',', which is empty; expected" in capsys.readouterr().err


def test_an_inconclusive_comparison_is_red_where_that_was_asked_for(capsys: pytest.CaptureFixture[str]) -> None:
    store_run("a")
    store_run("b", factor=0.95)
    words = ["compare", "a", "b", "--verdict", "evidence"]
    assert main(words) == 0
    assert "no regression shown in 2 settings against a, 2 inconclusive" in capsys.readouterr().out
    assert main([*words, "--inconclusive", "fail", "--json", "found.json"]) == 1
    told = "INCONCLUSIVE: 1 of 2 settings against a: driver under 200 ms latency"
    assert told in capsys.readouterr().out
    found = json.loads(Path("found.json").read_text())
    assert (found["regressed"], found["conclusion"], found["terms"]["inconclusive"]) == (True, told, "fail")
    assert main([*words, "--inconclusive", "skip"]) == 4
    assert "there is no way to treat inconclusive verdicts named 'skip'" in capsys.readouterr().err


def test_a_file_that_nests_too_deep_is_refused_wherever_it_lies(capsys: pytest.CaptureFixture[str]) -> None:
    store_run("a")
    Path("deep.json").write_text("[" * 100_000)
    assert main(["compare", "deep.json", "a"]) == 4
    assert "'deep.json' is " in capsys.readouterr().err
    Path("suites/baselines").mkdir(parents=True)
    Path("deep.json").rename("suites/baselines/driver.json")
    assert main(["compare", "baseline", "a"]) == 4
    assert "driver.json' is not valid JSON: " in capsys.readouterr().err


def test_a_rule_that_there_is_not_names_the_option_of_the_command(capsys: pytest.CaptureFixture[str]) -> None:
    store_run("a")
    assert main(["compare", "a", "a", "--verdict", "pt"]) == 4
    told = capsys.readouterr().err
    assert "there is no verdict rule named 'pt'." in told
    assert "Set it with --verdict." in told


@pytest.mark.parametrize(
    ("limit", "code"), [("ds:-60%", 0), ("ds:-40", 0), ("ds:-10", 1), ("sr:-0.1", 1), ("rd:+0.05", 1), ("rd:+0.6", 0)]
)
def test_fail_on_says_what_may_get_worse(limit: str, code: int) -> None:
    store_run("a")
    store_run("b", factor=0.5)
    assert main(["compare", "a", "b", "--fail-on", limit]) == code


def test_fail_on_may_be_repeated() -> None:
    store_run("a")
    store_run("b", factor=0.5)
    assert main(["compare", "a", "b", "--fail-on", "ds:-60%", "--fail-on", "rd:+0.05"]) == 1


def test_other_routes_are_refused_unless_allowed(capsys: pytest.CaptureFixture[str]) -> None:
    store_run("a")
    store_run("b", digest="d1")
    assert main(["compare", "a", "b"]) == 4
    shown = capsys.readouterr().out
    assert "NOT COMPARED with a: 40 of 40 routes have changed under the same id" in shown
    assert "DS" not in shown.splitlines()[1]
    assert main(["compare", "a", "b", "--json", "found.json"]) == 4
    found = json.loads(Path("found.json").read_text())
    assert (found["regressed"], found["cells"]) == (None, [])
    assert "40 of 40 routes have changed under the same id" in found["refused"][0]
    assert main(["compare", "a", "b", "--on-mismatch", "warn"]) == 0


def test_routes_that_the_new_run_did_not_drive_are_other_routes(capsys: pytest.CaptureFixture[str]) -> None:
    store_run("a")
    store_run("b", routes=10)
    assert main(["compare", "a", "b"]) == 4
    shown = capsys.readouterr().out
    assert (
        "NOT COMPARED with a: b lacks routes of a: 30 of 40 under clean (11, 12, 13, 14, 15 and 25 more), and 1 more. "
        "Drive these routes, too, or give --on-mismatch=warn" in shown
    )
    assert main(["compare", "a", "b", "--on-mismatch", "warn"]) == 0
    shown = capsys.readouterr().out
    assert "warning: b lacks routes of a" in shown
    assert "10 of 40  pass" in shown
    assert "no regression on 10 of 40 routes in 2 settings against a: not one score changed" in shown
    assert main(["compare", "b", "a"]) == 0
    shown = capsys.readouterr().out
    assert "note: not in b: 30 of 40 under clean (11, 12, 13, 14, 15 and 25 more), and 1 more" in shown
    assert "no regression on 10 of 40 routes in 2 settings against b: not one score changed" in shown


@pytest.mark.parametrize("which", ["a", "b"])
def test_a_run_that_stopped_at_its_verdicts_says_nothing_about_two_runs(
    which: str, capsys: pytest.CaptureFixture[str]
) -> None:
    store_run("a")
    store_run("b")
    store_run(which, spared=28)
    assert main(["compare", "a", "b"]) == 4
    shown = capsys.readouterr().out
    assert f"NOT COMPARED with a: {which} was driven only until its verdicts were clear, so its scores " in shown
    assert "12 of 40 routes of routes.xml under clean, and 1 more. Drive that run with --drive-" in shown
    assert shown.count("refused: ") == 1
    assert main(["compare", "a", "b", "--on-mismatch", "warn"]) == 0
    assert "no regression on 12 of 40 routes in 2 settings against a" in capsys.readouterr().out


def test_runs_are_found_from_a_folder_below(monkeypatch: pytest.MonkeyPatch) -> None:
    store_run("a")
    store_run("b")
    Path("deep/er").mkdir(parents=True)
    monkeypatch.chdir("deep/er")
    assert main(["compare", "a", "b"]) == 0


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["before", "befor"], "Did you mean 'before'"),
        (["before", "x.json"], "no run file named 'x.json'"),
        (["before", "other.json"], "is not a run"),
        (["before", "old.json"], "has schema 99"),
        (["before", "torn.json"], "is damaged"),
        (["baseline", "before"], "no baseline was blessed yet"),
        (["before", "before"], "A and B are both 'before', and no run is worse than itself"),
        (["before", "latest"], "A and B are both 'before'"),
        (["before", ".drive-robust/runs/before.json"], "A and B are both '.drive-robust/runs/before.json'"),
        (["before", "before", "--fail-on", "ds"], "--fail-on is 'ds'"),
        (["before", "before", "--verdict", "evidnce"], "Did you mean 'evidence'"),
        (["before", "before", "--on-mismatch", "wrn"], "Did you mean 'warn'"),
    ],
)
def test_what_cannot_be_compared_exits_with_4(
    arguments: list[str], told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    store_run("before")
    Path("other.json").write_text("{}")
    Path("old.json").write_text(json.dumps({"schema": 99, "settings": {}, "summaries": [], "episodes": []}))
    torn = {"schema": 1, "settings": {}, "summaries": [{}], "episodes": []}
    Path("torn.json").write_text(json.dumps(torn))
    assert main(["compare", *arguments]) == 4
    shown = capsys.readouterr().err
    assert told in shown
    assert shown.startswith("drive-robust: ")


def test_it_works_as_a_program(home: Path) -> None:
    store_run("a")
    store_run("b", factor=0.5)
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])}
    command = [sys.executable, "-m", "pytest_drive_robust.cli", "compare"]
    codes = {
        ("b", "a"): 0,
        ("a", "b"): 1,
        ("a", "nothing"): 4,
    }
    for arguments, code in codes.items():
        done = subprocess.run(
            [*command, *arguments], cwd=home, env=environment, capture_output=True, text=True, check=False
        )
        assert done.returncode == code, done.stdout + done.stderr
        assert "Traceback" not in done.stderr
