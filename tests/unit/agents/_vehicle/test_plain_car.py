"""Controls that were found for a plain car move the one that is driven as much."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drive_robust_agents._vehicle import mkz
from drive_robust_agents._vehicle.mkz import Pedals
from drive_robust_agents._vehicle.plain_car import WHEELBASE_M, pedals_from_plain, steer_from_plain
from pytest_drive_robust.domain.control import Control

DT_S = 0.05


@pytest.mark.parametrize(
    ("speed_mps", "plain", "acceleration_mps2"),
    [
        (5.0, Pedals(0.4, 0.0), 0.4 * 5.0 - 0.225),
        (20.0, Pedals(1.0, 0.0), 2.75 - 0.72),
        (10.0, Pedals(0.0, 0.5), -4.36),
    ],
    ids=["throttle", "all the power", "brakes"],
)
def test_pedals_accelerate_as_much(speed_mps: float, plain: Pedals, acceleration_mps2: float) -> None:
    throttle, brake = pedals_from_plain(speed_mps, plain)
    after = mkz.moved(speed_mps, Control(throttle, 0.0, brake)).speed_mps
    assert after == pytest.approx(speed_mps + acceleration_mps2 * DT_S, abs=1e-9)


@given(steer=st.floats(-0.4, 0.4))
def test_steering_turns_as_much(steer: float) -> None:
    wheel = math.tan(0.61 * steer)
    plain = math.cos(math.atan(0.5 * wheel)) * wheel / WHEELBASE_M
    turned = mkz.moved(5.0, Control(0.0, steer_from_plain(steer))).turn_rad
    assert turned == pytest.approx(DT_S * plain, abs=1e-9)
