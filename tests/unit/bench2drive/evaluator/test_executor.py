"""`--drive-sim bench2drive`: the same suite, driven by (a stand-in for) the official evaluator."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from fake_bench2drive import make

from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.options.execution import ExecutionOptions
from pytest_drive_robust.options.run import RunOptions
from pytest_drive_robust.plugin.external_options import external_options

REQUIREMENTS = "DS under 200 ms latency >= 10\\nRD under 200 ms latency <= 0.50"
SUITE = f"""
import pytest
from pytest_drive_robust import requirements


@pytest.mark.parametrize("requirement", requirements("{REQUIREMENTS}"))
def test_requirement(drive, requirement):
    drive.check(requirement)
"""


def run(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "pytest", "--drive-robust", "-q", "-p", "no:cacheprovider", *arguments]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False, timeout=600)


def test_a_suite_is_driven_by_the_evaluator_and_goes_on_where_it_was(
    tmp_path: Path, process_mark: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    root, carla, agent = make(tmp_path)
    monkeypatch.setenv("CARLA_ROOT", str(carla))
    (tmp_path / "suite").mkdir()
    (tmp_path / "suite" / "test_suite.py").write_text(SUITE)
    (tmp_path / "suite" / "pytest.ini").write_text(
        "[pytest]\ndrive_verdict = point\ndrive_stuck_stop = 60\ndrive_act_timeout = 9s\n"  # of other runs
    )
    chosen = ("--drive-sim=bench2drive", f"--drive-b2d-root={root}", f"--drive-agent=leaderboard:{agent}+ok")
    plan = run(tmp_path / "suite", *chosen, "--drive-plan")
    assert "6 episodes would be driven" in plan.stdout
    assert not (tmp_path / "suite" / ".drive-robust" / "bench2drive").exists()
    first = run(tmp_path / "suite", *chosen, "--drive-json", "run.json")
    assert first.returncode == 0, first.stdout + first.stderr
    document = json.loads((tmp_path / "suite" / "run.json").read_text())
    assert len(document["episodes"]) == 6  # three routes, clean and late
    assert {item["verdict"] for item in document["requirements"]} == {"pass"}
    assert document["settings"]["stuck_stop_s"] is None
    # nothing of the evaluator's is offered to git
    assert (tmp_path / "suite" / ".drive-robust" / "bench2drive" / ".gitignore").read_text() == "*\n"
    started = sorted((tmp_path / "suite" / ".drive-robust" / "bench2drive").rglob("*.json"))
    times = {path: os.stat(path).st_mtime_ns for path in started}
    assert times
    assert run(tmp_path / "suite", *chosen).returncode == 0
    assert {path: os.stat(path).st_mtime_ns for path in times} == times  # nothing was driven again
    assert (
        "Every episode that the verdicts need is stored: nothing would be driven."
        in run(tmp_path / "suite", *chosen, "--drive-plan").stdout
    )
    assert run(tmp_path / "suite", *chosen, "--drive-fresh").returncode == 0
    assert not {path for path in times if os.stat(path).st_mtime_ns == times[path]}  # everything was


def test_a_failure_of_what_the_agent_does_not_have_is_no_pass(
    tmp_path: Path, process_mark: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    root, carla, agent = make(tmp_path)
    monkeypatch.setenv("CARLA_ROOT", str(carla))
    judged = (
        "RD under occlusion 0.5 <= 0.30",
        "RD under GPS noise 5 m <= 0.30",
        "DS under occlusion 0.5 and 100 ms latency >= 10",
    )
    (tmp_path / "test_suite.py").write_text(SUITE.replace(REQUIREMENTS, "\\n".join(judged)))
    chosen = ("--drive-sim=bench2drive", f"--drive-b2d-root={root}", "--drive-routes=101", "--drive-verdict=point")
    ended = run(tmp_path, *chosen, f"--drive-agent=leaderboard:{agent}+no-camera")
    assert "2 passed, 1 error" in ended.stdout, ended.stdout + ended.stderr
    told = " ".join(ended.stdout.split())
    assert "occlusion 0.5 changed nothing in the only episode of agent" in told
    assert "the agent has no camera; of its sensors it declares to use gps, speed." in told
    assert run(tmp_path, *chosen, f"--drive-agent=leaderboard:{agent}+ok").returncode == 0


def test_the_time_of_an_episode_is_limited(tmp_path: Path, process_mark: str, monkeypatch: pytest.MonkeyPatch) -> None:
    root, carla, agent = make(tmp_path)
    monkeypatch.setenv("CARLA_ROOT", str(carla))
    (tmp_path / "test_suite.py").write_text(SUITE)
    chosen = ("--drive-sim=bench2drive", f"--drive-b2d-root={root}", f"--drive-agent=leaderboard:{agent}+hang")
    ended = run(tmp_path, *chosen, "--drive-routes=101", "--drive-episode-timeout=0.2s", "-s")
    assert ended.returncode == 1
    assert "the route took longer than 0.2 s" in ended.stdout
    assert ".log)" in ended.stdout  # what the evaluator said
    assert "drive-robust replay" not in ended.stdout  # which drives in simulators of ours only


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (("--drive-act-timeout=5s",), "--drive-act-timeout 5s has no effect"),
        (("--drive-memory=4",), "--drive-memory 4 has no effect"),
        (("--drive-stuck-stop=60",), "--drive-stuck-stop 60 has no effect"),
        (("--drive-lockstep=8",), "--drive-lockstep 8 has no effect"),
        (("--drive-executor=inline",), "--drive-executor inline has no effect"),
        (("--drive-executor=ray",), "--drive-executor ray has no effect"),
        (("--drive-probe",), "--drive-probe has no effect"),
        (("--drive-store=off",), "--drive-store off has no effect"),
    ],
    ids=lambda value: value[0] if isinstance(value, tuple) else "",
)
def test_what_the_evaluator_does_not_heed_is_refused(tmp_path: Path, given: tuple[str, ...], message: str) -> None:
    (tmp_path / "test_suite.py").write_text(SUITE)
    ended = run(tmp_path, "--drive-sim=bench2drive", "--drive-b2d-root=b2d", *given)
    assert ended.returncode == 4
    assert message in " ".join((ended.stdout + ended.stderr).split())


@pytest.mark.parametrize(
    ("given", "ini", "folder"),
    [
        (("--drive-store=../bigdisk",), "drive_store = elsewhere", "bigdisk"),
        ((), "drive_store = kept/here", "suite/kept/here"),
        ((), "drive_store = off", "suite/.drive-robust"),
    ],
    ids=["asked-for", "ini", "ini-off"],
)
def test_what_evaluators_write_goes_below_the_store(
    tmp_path: Path,
    process_mark: str,
    monkeypatch: pytest.MonkeyPatch,
    given: tuple[str, ...],
    ini: str,
    folder: str,
) -> None:
    root, carla, agent = make(tmp_path)
    monkeypatch.setenv("CARLA_ROOT", str(carla))
    suite = tmp_path / "suite"
    suite.mkdir()
    (suite / "test_suite.py").write_text(SUITE)
    (suite / "pytest.ini").write_text(f"[pytest]\ndrive_verdict = point\n{ini}\n")
    chosen = ("--drive-sim=bench2drive", f"--drive-b2d-root={root}", f"--drive-agent=leaderboard:{agent}+ok")
    ended = run(suite, *chosen, "--drive-routes=101", "-k", "DS", *given)
    assert ended.returncode == 0, ended.stdout + ended.stderr
    assert len(list(tmp_path.rglob("results/101.json"))) == 1
    assert len(list((tmp_path / folder / "bench2drive").glob("*/results/101.json"))) == 1


def test_the_evaluator_runs_in_the_python_that_was_named(
    tmp_path: Path, process_mark: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    root, carla, agent = make(tmp_path)
    monkeypatch.setenv("CARLA_ROOT", str(carla))
    (tmp_path / "test_suite.py").write_text(SUITE)
    (root / "leaderboard/leaderboard/route_parser.py").write_text("for item in scenario.getchildren():\n")
    chosen = ("--drive-sim=bench2drive", f"--drive-b2d-root={root}", f"--drive-agent=leaderboard:{agent}+ok")
    refused = run(tmp_path, *chosen)
    assert refused.returncode == 4
    assert "Give --drive-b2d-python a Python 3.7 or 3.8" in " ".join((refused.stdout + refused.stderr).split())
    assert not (tmp_path / ".drive-robust").exists()
    python = tmp_path / "old-python"  # it says to be one, and drives with ours
    python.write_text(
        f'#!/bin/sh\necho "$@" >> {tmp_path}/started\n[ "$1" = -c ] && echo 3 8 && exit\nexec {sys.executable} "$@"\n'
    )
    python.chmod(0o755)
    (tmp_path / "pytest.ini").write_text(f"[pytest]\ndrive_verdict = point\ndrive_b2d_python = {python}\n")
    driven = run(tmp_path, *chosen, "--drive-routes=101")
    assert driven.returncode == 0, driven.stdout + driven.stderr
    assert (tmp_path / "started").read_text().count("leaderboard_evaluator.py") == 2  # clean and late


class Config:
    """The part of pytest's configuration that is asked."""

    def __init__(self, **given: object) -> None:
        self._given = given

    def getoption(self, name: str, default: object = None) -> object:
        return self._given.get(name, default)

    def getini(self, name: str) -> str:
        return ""


@pytest.mark.parametrize(
    ("execution", "given", "message"),
    [
        (ExecutionOptions(), {}, "needs --drive-b2d-root=FOLDER"),
        (ExecutionOptions(b2d_root="b2d"), {"dist": "load", "tx": ["popen"]}, "leave -n out"),
        (ExecutionOptions(results="clean=x.json"), {}, "leave --drive-sim bench2drive out"),
    ],
)
def test_options_that_do_not_go_together_are_refused(
    execution: ExecutionOptions, given: dict[str, object], message: str
) -> None:
    with pytest.raises(UsageError, match=message):
        external_options(Config(**given), RunOptions(simulator="bench2drive"), execution)  # type: ignore[arg-type]
