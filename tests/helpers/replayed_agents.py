"""Agents in a module for `drive-robust replay`, the usual command line, and an episode as a run stores it."""

from __future__ import annotations

import sys
from pathlib import Path

from pytest_drive_robust.domain.route import Route
from pytest_drive_robust.perturbations.base import Setting
from pytest_drive_robust.runner.episode.loop import drive_episode
from pytest_drive_robust.runner.plan import EpisodeRequest
from pytest_drive_robust.simulators.base import SimulatorOptions
from pytest_drive_robust.simulators.routes import resolve_routes
from pytest_drive_robust.store.record_files import write_episode
from pytest_drive_robust.testing import FakeSimulator

FAKE = "pytest_drive_robust.testing:FakeSimulator"
SETTINGS = {"simulator": FAKE, "metrics": "bench2drive"}
AGENTS = """
from pytest_drive_robust import CameraSpec, Control, PlannedPath

class Good:
    def sensors(self): return [CameraSpec("front")]
    def reset(self, route, seed): pass
    def act(self, observation): return Control(throttle=1.0, steer=max(-1.0, min(1.0, -0.1 * observation.gps.y_m)))
    def plan(self): return PlannedPath(path=((0.0, 0.0), (20.0, 0.0)))

class Secretive(Good):
    def plan(self): raise RuntimeError("not telling")

class Bad(Good):
    def act(self, observation): return None

class OneThreaded(Good):
    def act(self, observation):
        import cv2
        assert cv2.getNumThreads() == 1, "as in a worker process"
        return super().act(observation)

class Slow(Good):
    def act(self, observation):
        return Control(throttle=0.2, steer=0.001 * observation.speed.mps)

class Jumpy(Good):
    def act(self, observation):
        assert observation.tick < 2 or abs(observation.gps.y_m) < 0.1, "far from its route"
        return Control(throttle=0.2)

class Debugged(Good):
    def act(self, observation):
        if observation.tick == 5:
            breakpoint()
        return super().act(observation)
"""
ROUTE = resolve_routes("full")[0]
GOOD = ("replay", ROUTE.id, "--agent", "film_agents:Good", "--sim", FAKE, "--tick-cap", "40")
LATE = ("--setting", "200 ms latency")


def stored(folder: Path, sentence: str, route: Route = ROUTE) -> Path:
    """The episode that GOOD drives under a setting, as a run stores it."""
    sys.path.insert(0, str(folder))
    from film_agents import Good  # type: ignore[import-not-found]

    setting = Setting.parse(sentence)
    result = drive_episode(
        FakeSimulator(SimulatorOptions(tick_cap=40)),
        Good(),
        route=route,
        setting=setting,
        seed=0,
        agent_name="film_agents:Good",
    )
    (folder / "run" / "episodes").mkdir(parents=True, exist_ok=True)
    path = folder / "run" / "episodes" / f"{EpisodeRequest(result.episode, route, setting).key}.episode"
    write_episode(path, result)
    return path
