"""A change of the agent, its weights, its Python or its variables is driven again: results are of what was driven."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from fake_bench2drive import ROUTES
from patience import PATIENCE_S

from pytest_drive_robust.domain.episode import Episode
from pytest_drive_robust.perturbations import Setting
from pytest_drive_robust.runner.plan import EpisodeRequest

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="CARLA's evaluator is watched through /proc")


def test_an_agent_that_was_edited_is_driven_again(official_executor: Callable[..., Any], tmp_path: Path) -> None:
    made, task = official_executor()
    made.submit(task("ok")).result(PATIENCE_S)
    with (tmp_path / "own_agent.py").open("a") as file:
        file.write("# another agent\n")
    made.submit(task("ok")).result(PATIENCE_S)
    assert len(list((tmp_path / "runs").glob("*/logs/*.log"))) == 2


@pytest.mark.parametrize(
    "changed",
    [
        "team/model.py", "team/nets/deep.py", "configs/base.py", "b2d/leaderboard/leaderboard/own.py",
        "b2d/scenario_runner/srunner/scenariomanager/timer.py", "carla/VERSION",
    ],
)  # fmt: skip
def test_what_the_evaluator_runs_is_a_part_of_what_was_driven(
    changed: str, official_executor: Callable[..., Any], tmp_path: Path
) -> None:
    made, task = official_executor()
    for name in ("team/nets", "configs"):
        (tmp_path / name).mkdir(parents=True)
    (tmp_path / "configs/small.py").write_text("")
    (tmp_path / "own_agent.py").rename(tmp_path / "team/own_agent.py")
    episode = Episode(f"leaderboard:{tmp_path}/team/own_agent.py+{tmp_path}/configs/small.py", ROUTES[0], "clean", 0)
    wanted = EpisodeRequest(episode, task("ok").route, Setting.CLEAN)
    before = made.run_folder(wanted)
    for name in ("team/notes.txt", "elsewhere.py"):
        (tmp_path / name).write_text("x")
        assert made.run_folder(wanted) == before
    (tmp_path / changed).write_text("0.9.16")
    assert made.run_folder(wanted) != before


def test_another_python_is_a_part_of_what_was_driven(official_executor: Callable[..., Any], tmp_path: Path) -> None:
    made, task = official_executor()
    before = made.run_folder(task("ok"))
    made._checkout = replace(made._checkout, python=str(tmp_path / "other-python"))
    assert made.run_folder(task("ok")) != before


@pytest.mark.parametrize("config", ["settings.py+weights.pth", "checkpoint", "b2d_weights.pth"])
def test_changed_weights_are_other_results(
    config: str, official_executor: Callable[..., Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    made, task = official_executor()
    (tmp_path / "checkpoint/epoch").mkdir(parents=True)
    (tmp_path / "settings.py").write_text("")
    weights = {
        "settings.py+weights.pth": tmp_path / "weights.pth",
        "checkpoint": tmp_path / "checkpoint/epoch/model.pth",
        "b2d_weights.pth": tmp_path / "b2d/b2d_weights.pth",  # the evaluator runs in the checkout
    }[config]
    weights.write_text("first")
    before = made.run_folder(task(config))
    assert made.run_folder(task(config)) == before
    weights.write_text("other weights")
    assert made.run_folder(task(config)) != before


def test_a_variable_that_the_agent_asks_for_is_a_part_of_what_was_driven(
    official_executor: Callable[..., Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made, task = official_executor()
    with (tmp_path / "own_agent.py").open("a") as file:
        file.write("import os\nMODE = os.environ.get('MODE')\nSAVED = os.environ.get('SAVE_PATH')\n")
    before = made.run_folder(task("ok"))
    for given in ("SAVE_PATH", "UNRELATED"):  # the evaluator gets a SAVE_PATH of ours
        monkeypatch.setenv(given, "1")
        assert made.run_folder(task("ok")) == before
    for asked in ("MODE", "PLANNER_TYPE"):
        monkeypatch.setenv(asked, "1")
        assert made.run_folder(task("ok")) != before
        monkeypatch.delenv(asked)
