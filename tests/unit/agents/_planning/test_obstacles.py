"""What has to be passed, and the ways around it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from privileged_scene import LANE_M, actor, seen, street

from drive_robust_agents._planning.obstacles import nearest_obstacle, ways_around


def test_a_badly_parked_car_is_passed_in_the_lane_as_far_as_that_goes() -> None:
    scene, traffic = seen(street(actor(60.0, 1.7)))
    found = nearest_obstacle(scene, traffic, np.zeros(scene.count), 20.0)
    assert found is not None
    assert (found.first_row, found.last_row) == pytest.approx((57.7, 62.3))
    (way,) = ways_around(scene, found, 20.0, 0.0, speed_mps=8.0)
    assert way.hold_m == pytest.approx(1.7 - 0.95 - 0.75 - 0.92, abs=0.01)
    assert way.shift[60] == pytest.approx(way.hold_m, abs=1e-6)
    assert way.shift[int(way.ends_row) + 1] == pytest.approx(0.0, abs=1e-6)


def test_where_there_is_a_lane_the_same_way_the_ego_takes_the_middle_of_it() -> None:
    scene, traffic = seen(street(actor(60.0, 1.0), same_way=True))
    found = nearest_obstacle(scene, traffic, np.zeros(scene.count), 20.0)
    assert found is not None
    assert ways_around(scene, found, 20.0, 0.0, speed_mps=8.0)[0].hold_m == pytest.approx(-LANE_M)


def test_a_queue_is_waited_for_and_a_car_that_never_moves_is_passed() -> None:
    truth = street(actor(60.0, 0.0))
    scene, traffic = seen(truth)
    assert nearest_obstacle(scene, traffic, np.zeros(scene.count), 20.0) is None
    for _ in range(20 * 15):
        traffic.update(truth.state, scene.graph)
    assert nearest_obstacle(scene, traffic, np.zeros(scene.count), 20.0) is not None


def test_what_stands_near_each_other_is_passed_in_one_go() -> None:
    scene, traffic = seen(street(actor(60.0, 1.2), actor(70.0, 1.0), actor(110.0, 1.2)))
    found = nearest_obstacle(scene, traffic, np.zeros(scene.count), 30.0)
    assert found is not None
    assert (found.first_row, found.last_row, found.left_m) == pytest.approx((57.7, 72.3, 0.05))


def test_an_oncoming_car_is_no_obstacle() -> None:
    scene, traffic = seen(street(actor(60.0, -1.2, speed_mps=2.0, yaw_rad=math.pi)))
    assert nearest_obstacle(scene, traffic, np.zeros(scene.count), 20.0) is None
