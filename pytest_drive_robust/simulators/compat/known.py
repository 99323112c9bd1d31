"""Which of highway-env's classes the kernels stand for, and refusal by name of all others."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TypeVar

from highway_env.road.lane import CircularLane, SineLane, StraightLane
from highway_env.road.regulation import RegulatedRoad
from highway_env.road.road import Road, RoadNetwork
from highway_env.vehicle.behavior import IDMVehicle, LinearVehicle
from highway_env.vehicle.behavior import AggressiveVehicle, DefensiveVehicle
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
    "act step clip_actions on_state_update handle_collisions _is_colliding polygon direction velocity "
    "lane_distance_to follow_road steering_control speed_control acceleration desired_gap change_lane_policy mobil "
    "acceleration_features steering_features index_to_speed speed_to_index".split()
)
_LANE_BEHAVIOUR = frozenset(
    "position local_coordinates heading_at width_at on_lane is_reachable_from after_end distance "
    "distance_with_heading local_angle".split()
)
_ROAD_BEHAVIOUR = frozenset({"act", "step", "neighbour_vehicles"})
_NETWORK_BEHAVIOUR = frozenset(
    {"get_lane", "get_closest_lane_index", "next_lane", "next_lane_given_next_road", "side_lanes"}
)


def _names(classes: Iterable[type]) -> str:
    return ", ".join(sorted(cls.__name__ for cls in classes))


def _find(thing: object, known: Mapping[type, Kind], behaviour: frozenset[str], what: str) -> Kind:
    """The entry of the nearest known class, when no class before it defines its own behaviour."""
    for cls in type(thing).__mro__:
        if cls in known:
            return known[cls]
        own = sorted(behaviour & vars(cls).keys())
        if own:
            raise SimulationError(
                f'compat="highway-env" does not know {what} of class {cls.__name__!r}: it has a {own[0]}() of its '
                f"own. Known: {_names(known)}, and subclasses that only set parameters. Drive without compat instead."
            )
    raise SimulationError(
        f'compat="highway-env" does not know {what} of class {type(thing).__name__!r}. Known: {_names(known)}. '
        "Drive without compat instead."
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
