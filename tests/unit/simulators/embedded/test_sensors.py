"""The rig of an episode."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from camera_scene import around, town

from pytest_drive_robust.domain.observation import CameraSpec
from pytest_drive_robust.domain.route import Weather
from pytest_drive_robust.errors import SimulationError
from pytest_drive_robust.simulators.embedded.sensors import Sensors

FRONT = CameraSpec("front")


@pytest.mark.parametrize(
    "cameras",
    [
        [replace(FRONT, width_px=0)],
        [replace(FRONT, fov_deg=180.0)],
        [replace(FRONT, x_m=math.nan)],
        [replace(FRONT, rate_hz=15.0)],
        [FRONT, FRONT],
    ],
)
def test_cameras_that_cannot_be_are_refused(cameras: list[CameraSpec]) -> None:
    with pytest.raises(SimulationError, match="'front'"):
        Sensors(cameras, lane_map=town(), weather=Weather(), route=around(), dt_s=0.05)
