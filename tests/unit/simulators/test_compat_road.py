"""highway-env's `Road.act` and `Road.step`, held against our kernels bit by bit."""

from __future__ import annotations

import pytest
from compat_roads import (
    DT_S,
    EVERYBODY,
    NETWORKS,
    add_objects,
    assert_same_states,
    compat_of,
    crowded_road,
    difference,
    drive_both,
)
from highway_env.vehicle.kinematics import Vehicle

from pytest_drive_robust.simulators.compat import CompatRoad


@pytest.mark.parametrize(("name", "seed"), [("highway", 1), ("merge", 3), ("roundabout", 1), ("intersection", 2)])
def test_traffic_moves_changes_lanes_and_crashes_as_in_highway_env(name: str, seed: int) -> None:
    road, compat = crowded_road(name, seed=seed), compat_of(name, seed=seed)
    changes = drive_both(road, compat, 80)
    assert changes > 0 or name == "intersection"  # which has one lane each way
    assert compat.crashed.any()


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("name", NETWORKS)
def test_twenty_vehicles_stay_the_same_for_400_ticks(name: str, seed: int) -> None:
    connected = seed % 2 == 1
    road = crowded_road(name, seed=seed, connected=connected)
    compat = compat_of(name, seed=seed, connected=connected)
    changes = drive_both(road, compat, 400)
    assert changes > 0 or name == "intersection"
    assert compat.crashed.any()


@pytest.mark.parametrize("name", ["merge", "intersection"])
def test_neighbours_on_connected_lanes_count_where_the_road_says_so(name: str) -> None:
    road, compat = crowded_road(name, seed=2, connected=True), compat_of(name, seed=2, connected=True)
    drive_both(road, compat, 60)
    unconnected = compat_of(name, seed=2)
    for _ in range(60):
        unconnected.step(DT_S)
    assert difference(road, unconnected) > 0.0


def test_a_tenth_of_a_millionth_more_headway_is_seen() -> None:
    """The control: a comparison that cannot fail would prove nothing."""
    road, other = crowded_road("highway", seed=3), crowded_road("highway", seed=3)
    for vehicle in other.vehicles:
        vehicle.TIME_WANTED *= 1.0000001
    compat = CompatRoad.from_road(other)
    for _ in range(60):
        road.act()
        road.step(DT_S)
        compat.step(DT_S)
    assert 0.0 < difference(road, compat) < 1e-2


def test_every_kind_of_vehicle_and_object_is_the_same() -> None:
    road, other = (crowded_road("merge", seed=4, kinds=(*EVERYBODY, Vehicle), count=21) for _ in range(2))
    add_objects(road)
    add_objects(other)
    compat = CompatRoad.from_road(other)
    drive_both(road, compat, 100)
    compat.write_back()
    assert any(body.hit or body.crashed for body in road.objects)
    assert_same_states(road, other, exact=compat.exact)
