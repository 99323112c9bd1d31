"""Which of highway-env's classes the kernels stand for, and refusal by name of all others."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TypeVar

from highway_env.road.lane import CircularLane, SineLane, StraightLane
from highway_env.road.regulation import RegulatedRoad
from highway_env.road.road import Road, RoadNetwork
from highway_env.vehicle.behavior import AggressiveVehicle, DefensiveVehicle, IDMVehicle, LinearVehicle
from highway_env.vehicle.controller import ControlledVehicle, MDPVehicle
from highway_env.vehicle.kinematics import Vehicle
from highway_env.vehicle.objects import Landmark, Obstacle

from pytest_drive_robust.errors import SimulationError
from pytest_drive_robust.simulators.compat import columns as c

__all__ = ["check_road", "lane_kind", "object_kind", "vehicle_kind"]

Kind = TypeVar("Kind")

LANES: Mapping[type, int] = {StraightLane: c.STRAIGHT, SineLane: c.SINE, CircularLane: c.CIRCLE}
OBJECTS: Mapping[type, int] = {Obstacle: c.OBSTACLE, Landmark: c.LANDMARK}
VEHICLES: Mapping[type, int] = {
    Vehicle: c.PLAIN,
    ControlledVehicle: c.CONTROLLED,
    MDPVehicle: c.MDP,
    IDMVehicle: c.IDM,
    LinearVehicle: c.LINEAR,
    AggressiveVehicle: c.LINEAR,
    DefensiveVehicle: c.LINEAR,
}
# a subclass may set parameters and build itself as it likes; if it defines one of these it behaves in its own way
_BODY_BEHAVIOUR = frozenset(
    {
        "_is_colliding", "acceleration", "acceleration_features", "act", "change_lane_policy", "clip_actions",
        "desired_gap", "direction", "follow_road", "handle_collisions", "index_to_speed", "lane_distance_to", "mobil",
        "on_state_update", "polygon", "speed_control", "speed_to_index", "steering_control", "steering_features",
        "step", "velocity",
    }
)  # fmt: skip
_LANE_BEHAVIOUR = frozenset(
    {
        "after_end", "distance", "distance_with_heading", "heading_at", "is_reachable_from", "local_angle",
        "local_coordinates", "on_lane", "position", "width_at",
    }
)  # fmt: skip
_ROAD_BEHAVIOUR = frozenset({"act", "step", "neighbour_vehicles"})
_NETWORK_BEHAVIOUR = frozenset(
    {"get_lane", "get_closest_lane_index", "next_lane", "next_lane_given_next_road", "side_lanes"}
)


def _names(classes: Iterable[type]) -> str:
    return ", ".join(sorted(cls.__name__ for cls in classes))


def _find(thing: object, known: Mapping[type, Kind], behaviour: frozenset[str], what: str) -> Kind:
    """The entry of the nearest known class, when no class before it defines its own behaviour."""
    own: list[str] = []
    for cls in type(thing).__mro__:
        if cls in known and not own:
            return known[cls]
        if cls in known:
            break
        own += sorted(behaviour & vars(cls).keys())
    else:
        own = []
    raise SimulationError(
        f'compat="highway-env" does not know {what} of class {type(thing).__name__!r}'
        + (f", which has a {own[0]}() of its own" if own else "")
        + f". Known: {_names(known)}, and subclasses that only set parameters. Drive without compat instead."
    )


def lane_kind(lane: object) -> int:
    """STRAIGHT, SINE or CIRCLE. Raises `SimulationError` for PolyLane and every other class."""
    return _find(lane, LANES, _LANE_BEHAVIOUR, "a lane")


def vehicle_kind(vehicle: object) -> int:
    """PLAIN to LINEAR. Raises `SimulationError` for BicycleVehicle and every other class."""
    return _find(vehicle, VEHICLES, _BODY_BEHAVIOUR, "a vehicle")


def object_kind(thing: object) -> int:
    """OBSTACLE or LANDMARK. Raises `SimulationError` for every other class."""
    return _find(thing, OBJECTS, _BODY_BEHAVIOUR, "an object")


def check_road(road: object, *, ignore_road_rules: bool) -> None:
    """Refuse a road that steps in its own way, among them `RegulatedRoad` unless its rules are to be left out."""
    if isinstance(road, RegulatedRoad) and not ignore_road_rules:
        raise SimulationError(
            f'compat="highway-env" steps {type(road).__name__!r} without its yielding rule (enforce_road_rules). '
            "Pass ignore_road_rules=True to do so, or drive without compat."
        )
    known = {Road: None, RegulatedRoad: None}
    _find(road, known, _ROAD_BEHAVIOUR, "a road")
    _find(getattr(road, "network", None), {RoadNetwork: None}, _NETWORK_BEHAVIOUR, "a road network")
