"""Between the arrays and the live road: writing back, reading again, snapshots."""

from __future__ import annotations

import numpy as np
from compat_roads import (
    DT_S,
    EVERYBODY,
    assert_same_states,
    bodies,
    compat_of,
    crowded_road,
    drive_both,
    state_of,
)
from highway_env.vehicle.behavior import IDMVehicle
from highway_env.vehicle.controller import MDPVehicle

from pytest_drive_robust.simulators.compat import CompatRoad


def test_highway_env_goes_on_from_what_was_written_back() -> None:
    road, other = (crowded_road("roundabout", seed=1, kinds=EVERYBODY) for _ in range(2))
    compat = CompatRoad.from_road(other)
    drive_both(road, compat, 40)
    compat.write_back()
    assert_same_states(road, other, exact=compat.exact)
    for _ in range(20):
        for one in (road, other):
            one.act()
            one.step(DT_S)
    assert_same_states(road, other, exact=compat.exact)


def test_vehicles_that_come_and_go_are_read_again() -> None:
    road, other = (crowded_road("intersection", seed=7) for _ in range(2))
    compat = CompatRoad.from_road(other, ego=other.vehicles[5])
    drive_both(road, compat, 20)
    compat.write_back()
    for one in (road, other):
        del one.vehicles[2]
        one.vehicles.append(IDMVehicle.make_on_lane(one, ("o1", "ir1", 0), 5.0, speed=8.0))
    compat.read_back()
    assert compat.ego == 4
    drive_both(road, compat, 20)


def test_a_snapshot_brings_the_same_future_back() -> None:
    compat = compat_of("merge", seed=8)
    for _ in range(20):
        compat.step(DT_S)
    saved = compat.snapshot()
    futures = []
    for _ in range(2):
        for _ in range(40):
            compat.step(DT_S)
        futures.append((compat.positions_m.tobytes(), compat.speeds_mps.tobytes(), compat.crashed.tobytes()))
        compat.restore(saved)
    assert futures[0] == futures[1]


def test_the_live_road_stands_still_until_it_is_written() -> None:
    road = crowded_road("highway", seed=9, count=5)
    before = [state_of(body) for body in bodies(road)]
    compat = CompatRoad.from_road(road)
    compat.step(DT_S)
    assert [state_of(body) for body in bodies(road)] == before
    compat.write_back()
    assert np.array_equal(np.array([vehicle.position for vehicle in road.vehicles]), compat.positions_m)


def test_a_road_that_records_histories_gets_one_entry_per_writing() -> None:
    road = crowded_road("highway", seed=9, count=5, kinds=(MDPVehicle, IDMVehicle))
    road.record_history = True
    compat = CompatRoad.from_road(road)
    for _ in range(3):
        compat.step(DT_S)
        compat.write_back()
    assert [len(vehicle.history) for vehicle in road.vehicles] == [3] * 5
    assert road.vehicles[0].history[0].position.tolist() == compat.positions_m[0].tolist()
