"""Pairs of equal highway-env roads full of traffic: one for highway-env to step, one for our kernels."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from highway_env.envs import HighwayEnv, IntersectionEnv, MergeEnv, RoundaboutEnv
from highway_env.road.road import Road, RoadNetwork
from highway_env.vehicle.behavior import AggressiveVehicle, DefensiveVehicle, IDMVehicle, LinearVehicle
from highway_env.vehicle.controller import ControlledVehicle, MDPVehicle
from highway_env.vehicle.kinematics import Vehicle
from highway_env.vehicle.objects import Landmark, Obstacle

from pytest_drive_robust.simulators.compat import CompatRoad

DT_S = 0.05
TOLERANCE_ELSEWHERE = 1e-9  # where numpy's arithmetic cannot be matched
NETWORKS = ("highway", "merge", "roundabout", "intersection")
EVERYBODY = (IDMVehicle, AggressiveVehicle, ControlledVehicle, MDPVehicle, LinearVehicle, DefensiveVehicle)
_ENVIRONMENTS = {
    "highway": HighwayEnv,
    "merge": MergeEnv,
    "roundabout": RoundaboutEnv,
    "intersection": IntersectionEnv,
}
_made: dict[str, RoadNetwork] = {}


def network(name: str) -> RoadNetwork:
    """The lanes of a highway-env environment; nothing that a test does changes them."""
    if name not in _made:
        # IntersectionEnv sets parameters on the class of its vehicles and leaves them there
        before = {key: value for key, value in vars(IDMVehicle).items() if key.isupper()}
        smallest = {"vehicles_count": 1, "initial_vehicle_count": 1, "simulation_frequency": 2, "policy_frequency": 1}
        _made[name] = _ENVIRONMENTS[name](config=smallest).road.network
        for key, value in before.items():
            setattr(IDMVehicle, key, value)
    return _made[name]


def crowded_road(
    name: str, *, seed: int, count: int = 20, kinds: Sequence[type[Vehicle]] = (IDMVehicle,), connected: bool = False
) -> Road:
    """`count` vehicles at random places of a network, half of them with a route; the same for the same arguments."""
    road = Road(
        network(name), np_random=np.random.RandomState(0), neighbour_vehicles_connected_lanes=connected
    )  # fmt: skip
    draw = np.random.Generator(np.random.Philox(seed))
    indices = list(road.network.lanes_dict())
    while len(road.vehicles) < count:
        index = indices[int(draw.integers(len(indices)))]
        lane = road.network.get_lane(index)
        s = draw.uniform(0.0, min(lane.length, 200.0))
        position = lane.position(s, draw.uniform(-0.5, 0.5))
        if any(np.linalg.norm(other.position - position) < 7.0 for other in road.vehicles):
            continue
        kind = kinds[len(road.vehicles) % len(kinds)]
        speed = draw.uniform(0.4, 1.1) * lane.speed_limit
        vehicle = kind(road, position, lane.heading_at(s), speed)
        if isinstance(vehicle, ControlledVehicle):
            vehicle.target_speed = vehicle.target_speed if kind is MDPVehicle else draw.uniform(0.8, 1.3) * speed
            if draw.uniform() < 0.5:
                vehicle.plan_route_to(index[1])
        if isinstance(vehicle, IDMVehicle):
            vehicle.DELTA = draw.uniform(3.5, 4.5)
            vehicle.POLITENESS = draw.uniform(0.0, 0.3)
        else:
            vehicle.act({"acceleration": draw.uniform(-1.0, 1.0), "steering": draw.uniform(-0.02, 0.02)})
        road.vehicles.append(vehicle)
    return road


def add_objects(road: Road) -> None:
    """An obstacle and a landmark in the way of the first vehicles."""
    for kind, vehicle in zip((Obstacle, Landmark), road.vehicles, strict=False):
        lane = vehicle.lane
        s = lane.local_coordinates(vehicle.position)[0] + 25.0
        road.objects.append(kind(road, lane.position(s, 0.3), lane.heading_at(s)))


def bodies(road: Road) -> list[Any]:
    return [*road.vehicles, *road.objects]


def difference(road: Road, compat: CompatRoad) -> float:
    """The largest difference of position [m], heading [rad] and speed [m/s]; infinite when a flag or lane differs."""
    live = bodies(road)
    if [body.crashed for body in live] != compat.crashed.tolist():
        return np.inf
    if [body.lane_index for body in live] != compat.lane_indices:
        return np.inf
    return max(
        float(np.abs(np.array([body.position for body in live]) - compat.positions_m).max()),
        float(np.abs(np.array([body.heading for body in live]) - compat.headings_rad).max()),
        float(np.abs(np.array([body.speed for body in live]) - compat.speeds_mps).max()),
    )


def state_of(body: Any) -> dict[str, Any]:
    """Everything that a later step of highway-env depends on, in comparable values."""
    names = (
        "position", "heading", "speed", "crashed", "hit", "impact", "lane_index", "action", "target_lane_index",
        "target_speed", "speed_index", "timer", "route",
    )  # fmt: skip
    state = {name: getattr(body, name) for name in names if hasattr(body, name)}
    return {name: value.tolist() if isinstance(value, np.ndarray) else value for name, value in state.items()}


def assert_same_states(road: Road, other: Road, *, exact: bool) -> None:
    """Every vehicle and object of one road is as its twin on the other."""
    for body, twin in zip(bodies(road), bodies(other), strict=True):
        mine, theirs = state_of(body), state_of(twin)
        if not exact:
            for name in ("position", "heading", "speed", "action", "target_speed", "timer", "impact"):
                if mine.get(name) is not None:
                    assert mine.pop(name) == pytest.approx(theirs.pop(name), abs=TOLERANCE_ELSEWHERE)
        assert mine == theirs


def changes_lane(road: Road) -> int:
    """How many vehicles are on the way to another lane of their road."""
    return sum(
        vehicle.target_lane_index != vehicle.lane_index and vehicle.target_lane_index[:2] == vehicle.lane_index[:2]
        for vehicle in road.vehicles
        if isinstance(vehicle, ControlledVehicle)
    )


def assert_same(road: Road, compat: CompatRoad) -> None:
    assert difference(road, compat) <= (0.0 if compat.exact else TOLERANCE_ELSEWHERE)


def drive_both(road: Road, compat: CompatRoad, ticks: int) -> int:
    """Step both, compare after each tick; how often a lane change was under way."""
    changes = 0
    for _ in range(ticks):
        road.act()
        road.step(DT_S)
        compat.step(DT_S)
        assert_same(road, compat)
        changes += changes_lane(road)
    return changes


def compat_of(name: str, **given: object) -> CompatRoad:
    return CompatRoad.from_road(crowded_road(name, **given))  # type: ignore[arg-type]
