"""The schema of the leaderboard's route files for each of the 44 scenario types, and the road that the type needs.

Source of the required and optional elements: Bench2Drive `leaderboard/data/bench2drive220.xml` and the
constructors in `scenario_runner/srunner/scenarios`.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass, replace
from enum import Enum

from pytest_drive_robust.domain.route import ScenarioSpec
from pytest_drive_robust.errors import nearest

_TRACED_TOWN = re.compile(r"(?:\S*/)?Town\d{1,6}(?:HD)?(?:_Opt)?")
_CARLA_TOWN = re.compile(r"(?:\S*/)?Town(?:0[1-9]|1[0-5])(?:HD)?(?:_Opt)?")


def is_traced(town: str) -> bool:
    """Return whether a road is built around the routes of a town of this name: `Town` and a number.

    The towns of CARLA have such names; other numbers are for a user's own polylines: `Town1`, `Town77`, `Town123`.
    """
    return _TRACED_TOWN.fullmatch(town) is not None


def is_carla(town: str) -> bool:
    """Return whether a town is CARLA's (`Town01` to `Town15`, `Town10HD`), so that others read its route files, too."""
    return _CARLA_TOWN.fullmatch(town) is not None


class Place(Enum):
    """The kind of road that a scenario type needs."""

    STREET = "road"
    JUNCTION = "junction"
    EXIT = "exit from a lane beside"
    ENTRY = "entry into a lane beside"
    CUT_IN = "entry ramp beside"


@dataclass(frozen=True, slots=True)
class Roads:
    """The road that is built around the route's lane.

    `lanes` is the number of lanes per way, `own` the ego's lane from the left; `two_ways` adds oncoming lanes to a
    street. `arms` and `control` describe the junction; `control` is `"light"`, `"stop"` or None.
    """

    place: Place
    lanes: int = 1
    own: int = 0
    two_ways: bool = True
    parking: bool = False
    biking: bool = False
    arms: int = 4
    control: str | None = None
    speed_mps: float = 12.5


@dataclass(frozen=True, slots=True)
class TypeSchema:
    """The road of a scenario type, its directions, and its required and optional elements with `x`, `y` and `z`."""

    roads: Roads
    directions: tuple[str, ...] = ()
    locations: tuple[str, ...] = ()
    optional_locations: tuple[str, ...] = ()


_RANGES: dict[str, tuple[float, float]] = {
    "distance": (0.0, 500.0),
    "speed": (0.0, 200.0),
    "flow_speed": (0.1, 50.0),
    "flow_distance": (1.0, 500.0),
    "crossing_angle": (-90.0, 90.0),
    "offset": (-3.0, 3.0),
    "front_vehicle_distance": (0.0, 100.0),
    "behind_vehicle_distance": (0.0, 100.0),
    "bicycle_drive_distance": (0.0, 1000.0),
    "bicycle_speed": (0.1, 100.0),
    "frequency": (1.0, 1000.0),
    "source_dist_interval": (1.0, 1000.0),
}
"""Metres, km/h for `speed` and `bicycle_speed`, m/s for `flow_speed`, degrees for `crossing_angle`."""
_FLOW_TYPES = (
    "CrossingBicycleFlow", "EnterActorFlow", "HighwayExit", "InterurbanActorFlow", "InterurbanAdvancedActorFlow",
    "MergerIntoSlowTraffic", "MergerIntoSlowTrafficV2", "NonSignalizedJunctionLeftTurn",
    "NonSignalizedJunctionLeftTurnEnterFlow", "NonSignalizedJunctionRightTurn", "SignalizedJunctionLeftTurn",
    "SignalizedJunctionLeftTurnEnterFlow", "SignalizedJunctionRightTurn",
)  # fmt: skip
_OBSTACLES = ("Accident", "ConstructionObstacle", "HazardAtSideLane", "ParkedObstacle")
_OBSTACLES_TWO_WAYS = tuple(f"{name}TwoWays" for name in _OBSTACLES)
READERS: dict[str, tuple[str, ...]] = {
    "distance": (
        *_OBSTACLES, *_OBSTACLES_TWO_WAYS, "DynamicObjectCrossing", "HighwayCutIn", "InvadingTurn",
        "ParkingCrossingPedestrian", "ParkingCutIn", "StaticCutIn", "VehicleOpensDoorTwoWays",
        "YieldToEmergencyVehicle",
    ),
    "speed": _OBSTACLES,
    "flow_speed": _FLOW_TYPES,
    "flow_distance": ("ParkingExit",),
    "crossing_angle": ("DynamicObjectCrossing", "ParkingCrossingPedestrian"),
    "offset": ("InvadingTurn",),
    "front_vehicle_distance": ("ParkingExit",),
    "behind_vehicle_distance": ("ParkingExit",),
    "bicycle_drive_distance": ("HazardAtSideLane", "HazardAtSideLaneTwoWays"),
    "bicycle_speed": ("HazardAtSideLane", "HazardAtSideLaneTwoWays"),
    "frequency": (*_OBSTACLES_TWO_WAYS, "VehicleOpensDoorTwoWays"),
    "source_dist_interval": _FLOW_TYPES,
}  # fmt: skip
"""The scenario types of the embedded world that read an element of numbers."""
_INTERVALS = ("frequency", "source_dist_interval")
"""Elements with `from` and `to`, or one `value`."""

_SIDES = ("left", "right")
_BEARINGS = ("left", "right", "opposite")
_FLOW = ("start_actor_flow", "end_actor_flow")
_CITY_SPEED_MPS, _COUNTRY_SPEED_MPS = 11.0, 20.0
_NARROW = TypeSchema(Roads(Place.STREET))
_LANE_BESIDE = TypeSchema(Roads(Place.STREET, lanes=2, own=1, speed_mps=13.9), _SIDES)
_KERB = TypeSchema(Roads(Place.STREET, parking=True, speed_mps=11.0), _SIDES)
_EXIT = TypeSchema(Roads(Place.EXIT, two_ways=False, speed_mps=_COUNTRY_SPEED_MPS), locations=_FLOW)
_ENTRY = replace(_EXIT, roads=replace(_EXIT.roads, place=Place.ENTRY))
_OPEN = TypeSchema(Roads(Place.JUNCTION, speed_mps=_CITY_SPEED_MPS))
_LIGHTS = TypeSchema(replace(_OPEN.roads, control="light"))

SCHEMA: dict[str, TypeSchema] = {
    "Accident": _LANE_BESIDE,
    "AccidentTwoWays": _NARROW,
    "BlockedIntersection": _OPEN,
    "ConstructionObstacle": _LANE_BESIDE,
    "ConstructionObstacleTwoWays": _NARROW,
    "ControlLoss": _NARROW,
    "CrossingBicycleFlow": TypeSchema(replace(_LIGHTS.roads, biking=True), locations=_FLOW),
    "DynamicObjectCrossing": replace(_NARROW, directions=_SIDES),
    "EnterActorFlow": replace(_OPEN, locations=_FLOW),
    "HardBreakRoute": _NARROW,
    "HazardAtSideLane": _LANE_BESIDE,
    "HazardAtSideLaneTwoWays": _NARROW,
    "HighwayCutIn": TypeSchema(
        Roads(Place.CUT_IN, two_ways=False, speed_mps=_COUNTRY_SPEED_MPS),
        locations=("other_actor_location",),
        optional_locations=("end_location",),
    ),
    "HighwayExit": _EXIT,
    "InterurbanActorFlow": _EXIT,
    "InterurbanAdvancedActorFlow": replace(_ENTRY, directions=_SIDES),
    "InvadingTurn": TypeSchema(Roads(Place.STREET, speed_mps=_CITY_SPEED_MPS)),
    "MergerIntoSlowTraffic": _EXIT,
    "MergerIntoSlowTrafficV2": _ENTRY,
    "NonSignalizedJunctionLeftTurn": _OPEN,
    "NonSignalizedJunctionLeftTurnEnterFlow": _OPEN,
    "NonSignalizedJunctionRightTurn": _OPEN,
    "OppositeVehicleRunningRedLight": replace(_LIGHTS, directions=_BEARINGS),
    "OppositeVehicleTakingPriority": replace(_OPEN, directions=_BEARINGS),
    "ParkedObstacle": _LANE_BESIDE,
    "ParkedObstacleTwoWays": _NARROW,
    "ParkingCrossingPedestrian": _KERB,
    "ParkingCutIn": _KERB,
    "ParkingExit": _KERB,
    "PedestrianCrossing": _OPEN,
    "SequentialLaneChange": TypeSchema(Roads(Place.STREET, lanes=3, own=1, two_ways=False, speed_mps=18.0)),
    "SignalizedJunctionLeftTurn": _LIGHTS,
    "SignalizedJunctionLeftTurnEnterFlow": _LIGHTS,
    "SignalizedJunctionRightTurn": _LIGHTS,
    "StaticCutIn": TypeSchema(replace(_LANE_BESIDE.roads, own=0), _SIDES),
    "T_Junction": TypeSchema(replace(_LIGHTS.roads, arms=3)),
    "VanillaNonSignalizedTurn": _OPEN,
    "VanillaNonSignalizedTurnEncounterStopsign": TypeSchema(replace(_OPEN.roads, control="stop")),
    "VanillaSignalizedTurnEncounterGreenLight": _LIGHTS,
    "VanillaSignalizedTurnEncounterRedLight": _LIGHTS,
    "VehicleOpensDoorTwoWays": TypeSchema(_KERB.roads),
    "VehicleTurningRoute": _OPEN,
    "VehicleTurningRoutePedestrian": _OPEN,
    "YieldToEmergencyVehicle": TypeSchema(replace(_LANE_BESIDE.roads, own=0)),
}
"""Every scenario type by its name in the route XML."""


_PLACES = frozenset(name for schema in SCHEMA.values() for name in (*schema.locations, *schema.optional_locations))


def is_numeric(element: str) -> bool:
    """Return whether the attributes of a parameter element of this name are numbers."""
    return element in _RANGES or element in _PLACES


def nearest_hint(given: str, known: Iterable[str]) -> str:
    """Return the hint `", did you mean 'speed'?"` for use within a sentence; an empty text when no name is close."""
    close = nearest(given, known)
    return "" if close is None else f", did you mean {close!r}?"


def problems_of(spec: ScenarioSpec, *, strict: bool = False, placed: bool = True) -> list[str]:
    """Return the mistakes in a scenario of a route file, one text each; empty for a correct scenario.

    `strict` refuses elements that the scenario does not read. `placed` requires the places of the scenario type.
    """
    schema = SCHEMA.get(spec.type)
    if schema is None:
        hint = nearest_hint(spec.type, sorted(SCHEMA))
        return [f"unknown scenario type {spec.type!r}{hint} (44 are known: `drive-robust routes list full`)"]
    found: list[str] = []
    for name in _RANGES:
        found += _bad_numbers(spec, name, ("from", "to", "value") if name in _INTERVALS else ("value",))
    for name in (*schema.locations, *schema.optional_locations):
        found += _bad_location(spec, name, needed=placed and name in schema.locations)
    if strict:
        found += _without_effect(spec, schema)
    direction = spec.texts.get("direction")
    if "direction" in spec.parameters or (
        direction is not None and schema.directions and direction not in schema.directions
    ):
        given = direction if direction is not None else spec.parameters["direction"]
        found.append(f"<direction> is {given!r}, expected {' or '.join(schema.directions or _BEARINGS)}")
    return found


def _without_effect(spec: ScenarioSpec, schema: TypeSchema) -> list[str]:
    """Return one text for each name of an element or attribute that would have no effect."""
    attributes: dict[str, tuple[str, ...]] = {
        name: ("from", "to", "value") if name in _INTERVALS else ("value",)
        for name, types in READERS.items()
        if spec.type in types
    }
    if schema.directions or spec.type in _OBSTACLES_TWO_WAYS:
        attributes["direction"] = ("value",)
    attributes |= dict.fromkeys((*schema.locations, *schema.optional_locations), ("x", "y", "z"))
    found = []
    for element in (*spec.parameters, *spec.texts):
        if element not in attributes:
            hint = nearest_hint(element, attributes)
            found.append(
                f"<{element}> is no element of {spec.type}{hint} (known: {', '.join(sorted(attributes)) or 'none'})"
            )
            continue
        found += [
            f"<{element}> has an attribute {other!r}, expected {', '.join(attributes[element])}"
            for other in sorted({*spec.parameters.get(element, ())}.difference(attributes[element]))
        ]
    return found


def _bad_numbers(spec: ScenarioSpec, name: str, attributes: tuple[str, ...]) -> list[str]:
    if name in spec.texts:
        return [f"<{name}> has value={spec.texts[name]!r}, expected a finite number"]
    if name not in spec.parameters:
        return []
    given, (low, high) = spec.parameters[name], _RANGES[name]
    if not any(attribute in given for attribute in attributes):
        return [f"<{name}> has no {' or '.join(attributes)}"]
    return [
        f"<{name}> has {attribute}={given[attribute]:g}, expected {low:g} to {high:g}"
        for attribute in attributes
        if attribute in given and not low <= given[attribute] <= high
    ]


def _bad_location(spec: ScenarioSpec, name: str, *, needed: bool) -> list[str]:
    given = spec.parameters.get(name)
    if given is None and name not in spec.texts:
        return [f"scenario {spec.type} needs <{name} x= y= z=>, which is missing"] if needed else []
    if given is None or "x" not in given or "y" not in given:
        return [f"<{name}> has no finite x and y"]
    return []
