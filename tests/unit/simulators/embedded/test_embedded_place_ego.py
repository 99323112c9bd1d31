"""`EmbeddedSimulator.place_ego`: the ego elsewhere, in the same moment."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pytest_drive_robust import Control
from pytest_drive_robust.errors import SimulationError
from pytest_drive_robust.simulators.embedded import EmbeddedSimulator
from pytest_drive_robust.simulators.embedded.routes import named_routes


@pytest.fixture
def simulator() -> EmbeddedSimulator:
    """Under way for three seconds, with the wheels turned a little."""
    made = EmbeddedSimulator()
    made.reset(named_routes("one-per-scenario")[3], seed=0, cameras=())
    for _ in range(60):
        made.step(Control(0.6, 0.05, 0.0))
    return made


def test_the_ego_is_put_there_and_nobody_else_moves(simulator: EmbeddedSimulator) -> None:
    before = simulator.frame
    frame = simulator.place_ego(x_m=3.0, y_m=-4.0, yaw_rad=7.0, speed_mps=5.0)
    assert (frame.ego.x_m, frame.ego.y_m, frame.ego.speed_mps) == (3.0, -4.0, 5.0)
    assert frame.ego.yaw_rad == pytest.approx(7.0 - math.tau)
    assert frame.tick == before.tick
    assert np.array_equal(frame.actors, before.actors)
    assert simulator.frame is frame
    assert simulator.observe().gps.x_m == 3.0


def test_the_imu_tells_what_follows_from_speed_and_wheels(simulator: EmbeddedSimulator) -> None:
    simulator.step(Control(0.0, 0.05, 0.0))
    ego = simulator.frame.ego
    same = simulator.place_ego(x_m=ego.x_m, y_m=ego.y_m, yaw_rad=ego.yaw_rad, speed_mps=ego.speed_mps).ego
    assert same.yaw_rate_radps == pytest.approx(ego.yaw_rate_radps, rel=0.02)
    assert same.right_mps2 == pytest.approx(ego.right_mps2, rel=0.03)
    assert same.forward_mps2 == ego.forward_mps2
    half = simulator.place_ego(x_m=ego.x_m, y_m=ego.y_m, yaw_rad=ego.yaw_rad, speed_mps=0.5 * ego.speed_mps).ego
    assert half.yaw_rate_radps == pytest.approx(0.5 * same.yaw_rate_radps)
    assert half.right_mps2 == pytest.approx(0.25 * same.right_mps2)


def test_an_ego_without_speed_is_at_rest(simulator: EmbeddedSimulator) -> None:
    ego = simulator.frame.ego
    still = simulator.place_ego(x_m=ego.x_m, y_m=ego.y_m, yaw_rad=ego.yaw_rad, speed_mps=0.0).ego
    assert (still.speed_mps, still.forward_mps2, still.right_mps2, still.yaw_rate_radps) == (0.0, 0.0, 0.0, 0.0)
    assert simulator.step(Control.NEUTRAL).ego.speed_mps == 0.0


def test_an_ego_at_speed_does_not_turn_faster_than_its_grip_allows(simulator: EmbeddedSimulator) -> None:
    for _ in range(40):
        simulator.step(Control(0.0, 1.0, 0.3))
    ego = simulator.frame.ego
    fast = simulator.place_ego(x_m=ego.x_m, y_m=ego.y_m, yaw_rad=ego.yaw_rad, speed_mps=20.0).ego
    assert abs(fast.right_mps2) == pytest.approx(7.5)


def test_a_restored_moment_is_as_if_nothing_had_been(simulator: EmbeddedSimulator) -> None:
    kept, before = simulator.snapshot(), simulator.frame
    simulator.place_ego(x_m=0.0, y_m=0.0, yaw_rad=0.0, speed_mps=9.0)
    simulator.step(Control(1.0, 0.0, 0.0))
    simulator.restore(kept)
    assert simulator.frame.ego == before.ego
    assert simulator.frame.tick == before.tick


@pytest.mark.parametrize("speed_mps", [-1.0, math.nan, math.inf])
def test_what_no_ego_can_have_is_refused(simulator: EmbeddedSimulator, speed_mps: float) -> None:
    with pytest.raises(SimulationError, match="expected finite numbers and a speed of 0 or more"):
        simulator.place_ego(x_m=0.0, y_m=0.0, yaw_rad=0.0, speed_mps=speed_mps)
