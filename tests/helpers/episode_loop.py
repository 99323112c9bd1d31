"""One episode in the closed loop with a tiny world."""

from __future__ import annotations

import numpy as np

from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.observation import CameraSpec, Observation
from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.perturbations import Setting
from pytest_drive_robust.runner.episode.loop import drive_episode
from pytest_drive_robust.simulators.base import Simulator
from pytest_drive_robust.testing import FakeSimulator, fake_route

CAMERA = CameraSpec("front", width_px=16, height_px=9)
FULL = Control(throttle=1.0)


def drive(
    agent: object,
    *,
    simulator: Simulator | None = None,
    setting: Setting = Setting.CLEAN,
    seed: int = 3,
    **options: object,
) -> EpisodeResult:
    return drive_episode(
        simulator or FakeSimulator(),
        agent,  # type: ignore[arg-type]
        route=fake_route(),
        setting=setting,
        seed=seed,
        agent_name="under test",
        **options,  # type: ignore[arg-type]
    )


def by_speed(observation: Observation) -> Control:
    """Depends on what is seen, so that whatever changes the observation changes the drive."""
    return Control(throttle=0.5 + 0.3 * float(np.sin(observation.gps.x_m)), steer=-0.01 * observation.gps.y_m)
