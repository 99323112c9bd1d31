"""How fast a line can be driven, and the steering and pedals for it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from drive_robust_agents._planning.control import pedals, speed_profile, steer_along
from drive_robust_agents._vehicle import mkz
from pytest_drive_robust.domain.truth import EgoState


def test_curves_are_slower_and_braking_for_them_starts_before() -> None:
    s = np.arange(100.0)
    turn = np.where(s < 50.0, 0.0, (s - 50.0) / 15.0)
    route = np.column_stack([np.cumsum(np.cos(turn)), np.cumsum(np.sin(turn)), turn, np.full(100, 12.0)])
    limits = speed_profile(route, lateral_mps2=2.8, brake_mps2=2.0)
    assert limits[80] == pytest.approx(math.sqrt(2.8 * 15.0), rel=0.02)
    assert limits[0] == 12.0
    assert np.all(np.diff(limits[20:50]) <= 0.0)
    assert np.all(limits[:-1] ** 2 - limits[1:] ** 2 <= 2.0 * 2.0 + 1e-9)


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_on_a_circle_the_wheels_keep_the_curvature_of_the_circle(sign: float) -> None:
    angle = np.arange(60) / 20.0
    line = np.column_stack([20.0 * np.sin(angle), sign * 20.0 * (1.0 - np.cos(angle)), sign * angle])
    slip = math.asin(mkz.REAR_M / 20.0)
    ego = EgoState(*line[20, :2], line[20, 2] - sign * slip, 5.0, 0.0, 0.0, sign * 5.0 / 20.0, 4.9, 1.8)
    assert steer_along(ego, line, 20) == pytest.approx(sign * mkz.steer(1.0 / 20.0), abs=0.02)


def test_a_standing_ego_is_held_by_its_brake() -> None:
    ego = EgoState(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 4.9, 1.8)
    assert pedals(ego, -1.0, 0.0).brake == 0.5
    assert pedals(ego, 2.0, 0.0).throttle > 0.3
