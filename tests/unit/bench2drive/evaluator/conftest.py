"""Fixtures around the stand-in for Bench2Drive."""

from __future__ import annotations

import uuid
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from fake_bench2drive import MARK, ROUTES, left_behind, make

from pytest_drive_robust.bench2drive.evaluator.__main__ import main
from pytest_drive_robust.bench2drive.evaluator.checkout import Checkout
from pytest_drive_robust.bench2drive.evaluator.executor import Bench2DriveExecutor
from pytest_drive_robust.domain.episode import Episode
from pytest_drive_robust.perturbations import Setting
from pytest_drive_robust.runner.plan import EpisodeRequest


@pytest.fixture
def process_mark(monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """Whatever a test starts has the mark in its environment, and is gone when the test is over.

    No other test has it: the folders of tests have equal names where these begin alike and run side by side.
    """
    mark = uuid.uuid4().hex
    monkeypatch.setenv(MARK, mark)
    monkeypatch.delenv("CARLA_ROOT", raising=False)
    yield mark
    assert left_behind(mark) == []


@pytest.fixture
def official_run(
    tmp_path: Path, process_mark: str, capsys: pytest.CaptureFixture[str]
) -> Callable[..., tuple[int, str]]:
    root, carla, agent = make(tmp_path)

    def run(mode: str, *more: str) -> tuple[int, str]:
        arguments = ["run", "--root", str(root), "--carla-root", str(carla), "--agent", f"{agent}+{mode}"]
        code = main([*arguments, "--out", str(tmp_path / "out"), "--port", "23400", *more])
        told = capsys.readouterr()
        return code, told.out + told.err

    return run


@pytest.fixture
def official_executor(tmp_path: Path, process_mark: str) -> Iterator[Callable[..., Any]]:
    made: list[Bench2DriveExecutor] = []
    root, carla, agent = make(tmp_path)

    def make_one(**options: Any) -> tuple[Bench2DriveExecutor, Callable[..., EpisodeRequest]]:
        options = {"tries": 2, "port": 24400, **options}
        driving = Bench2DriveExecutor(Checkout.find(root, carla_root=carla), folder=tmp_path / "runs", **options)
        made.append(driving)

        def task(mode: str, setting: Setting = Setting.CLEAN, *, route: int = 0, seed: int = 0) -> EpisodeRequest:
            episode = Episode(f"leaderboard:{agent}+{mode}", ROUTES[route], str(setting), seed)
            return EpisodeRequest(episode, driving.routes[route], setting)

        return driving, task

    yield make_one
    for driving in made:
        driving.close()
