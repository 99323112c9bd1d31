"""Plans of the ego against the tracks of others: when there is trouble."""

from __future__ import annotations

import math

import numpy as np
import pytest
from privileged_scene import actor, seen, street

from drive_robust_agents._planning.forecast import rollouts
from drive_robust_agents._planning.lateral import path_of
from drive_robust_agents._planning.projection import leaders
from pytest_drive_robust.domain.truth import GroundTruth

WAITING = np.array([1.2, 0.7, 0.25])


def seconds(truth: GroundTruth, *plans: tuple[float, float, float], stop_row: float = math.inf) -> list[float]:
    """Seconds until trouble in the ego's lane for each plan."""
    scene, traffic = seen(truth)
    ego = truth.state.ego
    path = path_of(scene, np.zeros(scene.count), ego.x_m, ego.y_m, speed_mps=ego.speed_mps)
    found, _ = rollouts(
        path, ego.x_m, ego.speed_mps, scene.size, traffic.forecast, traffic.boxes,
        leaders(path, ego.x_m, traffic.boxes), np.array(plans), scene.limits, scene.junctions, stop_row, WAITING,
        3.0, 30,
    )  # fmt: skip
    return list(found)


def test_driving_on_into_a_standing_car_is_trouble_and_braking_is_not() -> None:
    truth = street(actor(45.0, 0.0), speed_mps=10.0)
    going_on, braking = seconds(truth, (0.0, 99.0, 0.0), (-4.0, 99.0, -4.0))
    assert going_on == pytest.approx(1.8, abs=0.4)
    assert braking == pytest.approx(6.0)


def test_a_stop_row_is_kept_by_the_front_bumper() -> None:
    assert seconds(street(speed_mps=10.0), (0.0, 99.0, 0.0), stop_row=40.0)[0] == pytest.approx(1.6, abs=0.21)


def test_who_is_ahead_may_brake_hard_and_who_is_behind_brakes_for_the_ego() -> None:
    ahead = street(actor(34.0, 0.0, speed_mps=10.0), speed_mps=10.0)
    behind = street(actor(10.0, 0.0, speed_mps=12.0), speed_mps=10.0)
    assert seconds(ahead, (0.0, 0.4, -3.2))[0] < 6.0
    assert seconds(behind, (0.0, 99.0, 0.0))[0] == pytest.approx(6.0)
