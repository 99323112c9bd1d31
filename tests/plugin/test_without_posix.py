"""On a system without `fork`, `fcntl` and SIGKILL, such as Windows: what works, and what says that it does not."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from pytest_drive_robust.domain.episode import Episode
from pytest_drive_robust.jit.cache import cache_folder
from pytest_drive_robust.report.film.file_name import film_name

HELPER = Path(__file__).parents[1] / "helpers" / "without_posix.py"
OPTIONS = ["--drive-robust", "-q", "-p", "no:cacheprovider"]


@pytest.fixture
def run(suite, plugin_args, monkeypatch):
    """Run a module on such a system, beside a suite of one requirement on the fake simulator."""
    pytester = suite("DS under clean >= 60")
    monkeypatch.setenv("PYTHONPATH", str(HELPER.parents[2]))
    # HOME is another one here, and without `pwd` there is no telling where the kernels lie that are compiled already
    monkeypatch.setenv("XDG_CACHE_HOME", str(cache_folder().parents[1]))

    def run(*words):
        command = [sys.executable, str(HELPER), *words]
        return subprocess.run(command, cwd=pytester.path, capture_output=True, text=True, check=False)

    return run


def test_the_inline_executor_drives_keeps_and_reports(run):
    driven = run("pytest", *OPTIONS, "--drive-executor=inline", "--drive-report=report", "--drive-save=mine")
    assert driven.returncode == 0, driven.stdout + driven.stderr
    assert "1 passed" in driven.stdout
    again = run("pytest", *OPTIONS, "--drive-executor=inline", "--drive-compare=mine")
    assert again.returncode == 0, again.stdout + again.stderr
    assert "no regression" in again.stdout
    written = run("pytest_drive_robust.cli", "report", "mine", "--out", "again")
    assert written.returncode == 0, written.stdout + written.stderr


@pytest.mark.parametrize("executor", ["auto", "processes", "ray"])
def test_other_executors_say_what_is_missing_and_what_to_give(executor, run):
    refused = run("pytest", *OPTIONS, f"--drive-executor={executor}")
    assert refused.returncode == 4, refused.stdout + refused.stderr
    told = " ".join((refused.stdout + refused.stderr).split())
    expected = "processes" if executor == "auto" else executor
    assert f"--drive-executor {expected} needs worker processes" in told
    assert "has no os.fork, os.killpg, os.setsid, fcntl, resource." in told
    assert "Give --drive-executor inline" in told
    assert "Traceback" not in told


def test_the_official_evaluator_says_where_it_drives(run):
    refused = run("pytest", *OPTIONS, "--drive-sim=bench2drive", "--drive-b2d-root=.")
    assert refused.returncode == 4
    assert "--drive-sim bench2drive needs worker processes" in refused.stderr + refused.stdout
    assert "--drive-results SETTING=FOLDER" in refused.stderr + refused.stdout


def test_results_of_the_official_evaluator_are_read(run, tmp_path):
    refused = run("pytest", *OPTIONS, f"--drive-results={tmp_path / 'none.json'}")
    assert refused.returncode == 4, refused.stdout + refused.stderr
    assert "none.json" in refused.stderr + refused.stdout  # it looked for the file: nothing else was in the way


def test_a_replay_drives_and_is_filmed(run):
    pytest.importorskip("av", reason="films need av")
    replayed = run(
        "pytest_drive_robust.cli", "replay", "601", "--agent", "blind", "--setting", "clean", "--tick-cap", "60"
    )
    assert replayed.returncode == 0, replayed.stdout + replayed.stderr
    assert f"{film_name(Episode('blind', '601', 'clean', 0))}: " in replayed.stdout


def test_the_command_lists_what_there_is(run):
    assert "embedded" in run("pytest_drive_robust.cli", "list").stdout
