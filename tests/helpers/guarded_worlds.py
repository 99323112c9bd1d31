"""Worlds that break, and what the tests of guarded processes share."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from patience import PATIENCE_S

from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.episode import Episode
from pytest_drive_robust.domain.observation import CameraSpec
from pytest_drive_robust.domain.route import GlobalPlan, Route
from pytest_drive_robust.domain.truth import WorldState
from pytest_drive_robust.engine.worker_setup import WorkerSetup
from pytest_drive_robust.perturbations import Setting
from pytest_drive_robust.runner.plan import EpisodeRequest
from pytest_drive_robust.simulators.base import SimulatorOptions
from pytest_drive_robust.testing import FakeSimulator, fake_route

HERE = Path(__file__).parent
ROUTE = fake_route()
FAKE = "pytest_drive_robust.testing:FakeSimulator"


def worker_setup(simulator: str = FAKE, **changes: object) -> WorkerSetup:
    """Return how the worker process of a test comes to its registry; worlds of this file by their bare name."""
    name = simulator if ":" in simulator or simulator == "embedded" else f"guarded_worlds:{simulator}"
    made = WorkerSetup((str(HERE), *sys.path), str(Path.cwd()), (), name, SimulatorOptions(tick_cap=2000))
    return replace(made, **changes)  # type: ignore[arg-type]


def request(agent: str, *, setting: Setting = Setting.CLEAN, route: Route = ROUTE, seed: int = 0) -> EpisodeRequest:
    """Return an episode of an agent of `guarded_agents`, by its bare name, or of any other by its reference."""
    name = agent if ":" in agent or agent.islower() else f"guarded_agents:{agent}"
    return EpisodeRequest(Episode(name, route.id, str(setting), seed), route, setting)


def alive(pid: int) -> bool:
    """Return whether the process runs; one that ended and was not waited for does not."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def gone_within(pid: int, seconds: float = PATIENCE_S) -> bool:
    """Return whether the process ends in time."""
    deadline = time.monotonic() + seconds
    while alive(pid) and time.monotonic() < deadline:
        time.sleep(0.01)
    return not alive(pid)


class DiesInStep(FakeSimulator):
    def step(self, control: Control) -> WorldState:
        if self._tick == 20:
            os._exit(9)
        return super().step(control)


class HangsInStep(FakeSimulator):
    def step(self, control: Control) -> WorldState:
        if self._tick == 20:
            time.sleep(600.0)
        return super().step(control)


class LeavesInPlan(FakeSimulator):
    def plan(self) -> GlobalPlan:
        sys.exit(9)


class RaisesInStep(FakeSimulator):
    def step(self, control: Control) -> WorldState:
        if self._tick == 20:
            _count()
            raise OSError("lost the server")
        return super().step(control)


class DiesTwice(FakeSimulator):
    """Two processes die, the third one drives."""

    def reset(self, route: Route, *, seed: int, cameras: Sequence[CameraSpec]) -> WorldState:
        if _count() <= 2:
            os.abort()
        return super().reset(route, seed=seed, cameras=cameras)


def no_world(options: SimulatorOptions) -> FakeSimulator:
    raise FileNotFoundError("the licence of the world")


def _count() -> int:
    note = Path(os.environ["DRIVE_ROBUST_TEST_NOTE"])
    with note.open("a") as file:
        file.write("x")
    return len(note.read_text())
