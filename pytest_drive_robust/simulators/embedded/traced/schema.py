"""The schema of the leaderboard's route files for each of the 44 scenario types, and the road that the type needs.

Source of the required and optional elements: Bench2Drive `leaderboard/data/bench2drive220.xml` and the
constructors in `scenario_runner/srunner/scenarios`.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from enum import Enum

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


RANGES: dict[str, tuple[float, float]] = {
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
OBSTACLES_TWO_WAYS = tuple(f"{name}TwoWays" for name in _OBSTACLES)
READERS: dict[str, tuple[str, ...]] = {
    "distance": (
        *_OBSTACLES, *OBSTACLES_TWO_WAYS, "DynamicObjectCrossing", "HighwayCutIn", "InvadingTurn",
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
    "frequency": (*OBSTACLES_TWO_WAYS, "VehicleOpensDoorTwoWays"),
    "source_dist_interval": _FLOW_TYPES,
}  # fmt: skip
"""The scenario types of the embedded world that read an element of numbers."""
INTERVALS = ("frequency", "source_dist_interval")
"""Elements with `from` and `to`, or one `value`."""

_SIDES = ("left", "right")
BEARINGS = ("left", "right", "opposite")
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
    "OppositeVehicleRunningRedLight": replace(_LIGHTS, directions=BEARINGS),
    "OppositeVehicleTakingPriority": replace(_OPEN, directions=BEARINGS),
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
    return element in RANGES or element in _PLACES
