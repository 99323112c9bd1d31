"""What the ego is told between two ticks does what it does in highway-env."""

from __future__ import annotations

import math

import pytest
from compat_roads import (
    DT_S,
    EVERYBODY,
    assert_same,
    assert_same_states,
    crowded_road,
)
from highway_env.vehicle.behavior import IDMVehicle
from highway_env.vehicle.controller import ControlledVehicle, MDPVehicle
from highway_env.vehicle.kinematics import Vehicle

from pytest_drive_robust.simulators.compat import CompatRoad


def test_a_plain_ego_does_what_it_is_told() -> None:
    road, other = (crowded_road("highway", seed=5, kinds=(Vehicle, *EVERYBODY)) for _ in range(2))
    compat = CompatRoad.from_road(other, ego=other.vehicles[0])
    assert compat.ego == 0
    for tick in range(60):
        acceleration, steering = 3.0 * math.sin(0.2 * tick), 0.1 * math.cos(0.1 * tick)
        if tick % 3 == 0:
            road.vehicles[0].act({"acceleration": acceleration, "steering": steering})
        compat.step(DT_S, (acceleration, steering) if tick % 3 == 0 else None)
        road.act()
        road.step(DT_S)
        assert_same(road, compat)


@pytest.mark.parametrize("kind", [ControlledVehicle, MDPVehicle])
def test_a_controlled_ego_obeys_meta_actions(kind: type[Vehicle]) -> None:
    road, other = (crowded_road("highway", seed=6, count=8, kinds=(kind, IDMVehicle)) for _ in range(2))
    compat = CompatRoad.from_road(other, ego=other.vehicles[0])
    actions = ("FASTER", "LANE_RIGHT", "LANE_RIGHT", "IDLE", "SLOWER", "SLOWER", "LANE_LEFT", "SLOWER", "FASTER")
    for tick in range(45):
        action = actions[tick // 5] if tick % 5 == 0 else None
        if action is not None:
            road.vehicles[0].act(action)
        compat.step(DT_S, action)
        road.act()
        road.step(DT_S)
        assert_same(road, compat)
    compat.write_back()
    assert_same_states(road, other, exact=compat.exact)
