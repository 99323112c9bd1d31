"""`drive-robust bless`, in the process and from outside."""

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


def test_a_blessed_run_is_a_reference_for_later_ones(capsys: pytest.CaptureFixture[str]) -> None:
    store_run("a")
    store_run("b", factor=0.5)
    Path("gitconfig").write_text("[user]\n\tname = Planning Team\n\temail = planning@example.org\n")
    assert main(["bless", "a", "--reason", "first baseline"]) == 0
    assert "80 scores added, 0 replaced, 0 others kept" in capsys.readouterr().out
    told = json.loads(Path("suites/baselines/driver.json").read_text())
    (blessing,) = told["blessings"].values()
    assert (blessing["by"], blessing["reason"], blessing["run"]) == (
        "Planning Team <planning@example.org>",
        "first baseline",
        "a",
    )
    assert main(["compare", "baseline", "a"]) == 0
    assert main(["compare", "baseline:driver", "latest"]) == 1
    assert main(["compare", "suites/baselines/driver.json", "b"]) == 1


def test_other_routes_take_the_place_of_blessed_ones_only_where_that_is_asked_for(
    capsys: pytest.CaptureFixture[str],
) -> None:
    store_run("many")
    store_run("few", routes=20, digest="d1")
    assert main(["bless", "many", "--reason", "first"]) == 0
    assert main(["bless", "few", "--reason", "changed"]) == 4
    assert "Give --replace-routes if you changed the routes on purpose." in capsys.readouterr().err
    assert main(["bless", "few", "--reason", "changed", "--replace-routes"]) == 0
    told = capsys.readouterr().out
    assert "0 scores added, 40 replaced, 40 others kept\n" in told
    assert "40 of the kept scores are of other routes under the same settings" in told
    assert main(["bless", "few", "--reason", "these alone", "--only"]) == 0
    assert "0 scores added, 40 replaced, 0 others kept, 40 dropped" in capsys.readouterr().out


def test_nobody_is_made_up_where_git_knows_nobody() -> None:
    store_run("a")
    assert main(["bless", "a", "--reason", "why"]) == 0
    (blessing,) = json.loads(Path("suites/baselines/driver.json").read_text())["blessings"].values()
    assert blessing["by"] is None
    assert blessing["commit"] is None


def test_what_git_tells_may_be_in_any_encoding() -> None:
    store_run("a")
    Path("gitconfig").write_bytes(b"[user]\n\tname = J\xf6rg")
    assert main(["bless", "a", "--reason", "why"]) == 0
    (blessing,) = json.loads(Path("suites/baselines/driver.json").read_text(encoding="utf-8"))["blessings"].values()
    assert blessing["by"] == "J\N{REPLACEMENT CHARACTER}rg"


def test_half_characters_of_a_reason_are_kept() -> None:
    store_run("a")
    assert main(["bless", "a", "--reason", "for J\udcf6rg"]) == 0
    (blessing,) = json.loads(Path("suites/baselines/driver.json").read_text(encoding="utf-8"))["blessings"].values()
    assert blessing["reason"] == "for J\udcf6rg"
    assert main(["compare", "baseline", "a"]) == 0


def test_ci_never_blesses(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    store_run("a")
    monkeypatch.setenv("CI", "true")
    assert main(["bless", "a", "--reason", "why"]) == 4
    assert "CI never blesses" in capsys.readouterr().err
    assert not Path("suites").exists()


def test_a_run_with_a_broken_simulator_is_not_blessed(capsys: pytest.CaptureFixture[str]) -> None:
    store_run("a", crash=True)
    assert main(["bless", "a", "--reason", "why"]) == 4
    assert "is incomplete" in capsys.readouterr().err


def test_a_baseline_is_not_blessed_again(capsys: pytest.CaptureFixture[str]) -> None:
    store_run("a")
    main(["bless", "a", "--reason", "why"])
    for reference in ("baseline", "suites/baselines/driver.json"):
        assert main(["bless", reference, "--reason", "why"]) == 4
        assert "is a baseline, expected a run" in capsys.readouterr().err
    assert main(["bless", "auto", "--reason", "why"]) == 4
    assert "'auto' may stand for a baseline, expected a run" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["befor", "--reason", "why"], "Did you mean 'before'"),
        (["before", "--reason", " "], "--reason is empty, expected TEXT: "),
    ],
)
def test_what_cannot_be_blessed_exits_with_4(
    arguments: list[str], told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    store_run("before")
    assert main(["bless", *arguments]) == 4
    shown = capsys.readouterr().err
    assert told in shown
    assert shown.startswith("drive-robust: ")


def test_it_works_as_a_program(home: Path) -> None:
    store_run("a")
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])}
    command = [sys.executable, "-m", "pytest_drive_robust.cli", "bless", "a", "--reason", "why"]
    done = subprocess.run(command, cwd=home, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "Traceback" not in done.stderr


def test_a_run_that_was_cut_short_is_not_blessed_and_worse_than_a_whole_one(capsys: pytest.CaptureFixture[str]) -> None:
    store_run("whole")
    path = store_run("cut")
    document = json.loads(path.read_text())
    (row,) = [row for row in document["summaries"] if row["setting"] == "clean"]
    row["episodes_finished"] -= 5
    path.write_text(json.dumps(document))
    assert main(["bless", "cut", "--reason", "why"]) == 4
    assert "5 episodes were not driven, as the run ended before, or a verdict was an error" in capsys.readouterr().err
    store_run("again")
    assert main(["compare", "whole", "again"]) == 0
    assert main(["compare", "whole", "cut"]) == 1


def test_a_run_that_stopped_at_its_verdicts_is_not_blessed(capsys: pytest.CaptureFixture[str]) -> None:
    store_run("early", spared=28)
    assert main(["bless", "early", "--reason", "why"]) == 4
    told = capsys.readouterr().err
    assert (
        "early was driven only until its verdicts were clear, on 12 of 40 routes of routes.xml under clean, and 1 more"
        in told
    )
    assert "Drive it with --drive-save, or with --drive-verdict=point." in told
    assert not Path("suites").exists()


def test_a_folder_that_cannot_be_made_is_no_verdict(capsys: pytest.CaptureFixture[str]) -> None:
    store_run("a")
    Path("file").touch()
    assert main(["bless", "a", "--reason", "why", "--baselines", "file/baselines"]) == 4
    assert "drive-robust: file/baselines: Not a directory." in capsys.readouterr().err
