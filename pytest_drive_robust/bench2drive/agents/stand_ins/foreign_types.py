"""Stand-ins for the types that official agent files import from `carla`, its `agents`, the leaderboard and `srunner`.

Axes are CARLA's: x forward (east), y to the right (south), z up, metres and degrees; yaw grows clockwise seen from
above.
"""

from __future__ import annotations

import datetime
import importlib
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import Enum, IntEnum
from typing import Any, ClassVar


@dataclass
class Vector3D:
    """Three numbers."""

    x: float = 0.0
    y: float = 0.0
    z: float = 0.0

    def length(self) -> float:
        """Return the Euclidean norm."""
        return math.sqrt(self.x**2 + self.y**2 + self.z**2)

    def __add__(self, other: Vector3D) -> Vector3D:
        return type(self)(self.x + other.x, self.y + other.y, self.z + other.z)

    def __sub__(self, other: Vector3D) -> Vector3D:
        return type(self)(self.x - other.x, self.y - other.y, self.z - other.z)

    def __mul__(self, factor: float) -> Vector3D:
        return type(self)(self.x * factor, self.y * factor, self.z * factor)

    def __truediv__(self, divisor: float) -> Vector3D:
        return type(self)(self.x / divisor, self.y / divisor, self.z / divisor)


@dataclass
class Location(Vector3D):
    """A place in metres."""

    def distance(self, other: Location) -> float:
        """Return the distance to another place in metres."""
        return (self - other).length()


@dataclass
class Rotation:
    """Degrees: pitch up, yaw clockwise, roll clockwise seen from behind."""

    pitch: float = 0.0
    yaw: float = 0.0
    roll: float = 0.0

    def get_forward_vector(self) -> Vector3D:
        """Return where its front looks."""
        pitch, yaw = math.radians(self.pitch), math.radians(self.yaw)
        return Vector3D(math.cos(pitch) * math.cos(yaw), math.cos(pitch) * math.sin(yaw), math.sin(pitch))

    def get_right_vector(self) -> Vector3D:
        """Return where its right side looks."""
        pitch, yaw, roll = math.radians(self.pitch), math.radians(self.yaw), math.radians(self.roll)
        return Vector3D(
            math.cos(yaw) * math.sin(pitch) * math.sin(roll) - math.sin(yaw) * math.cos(roll),
            math.sin(yaw) * math.sin(pitch) * math.sin(roll) + math.cos(yaw) * math.cos(roll),
            -math.cos(pitch) * math.sin(roll),
        )


@dataclass
class Transform:
    """A place and a rotation."""

    location: Location = field(default_factory=Location)
    rotation: Rotation = field(default_factory=Rotation)

    def get_forward_vector(self) -> Vector3D:
        """Return where its front looks."""
        return self.rotation.get_forward_vector()

    def get_right_vector(self) -> Vector3D:
        """Return where its right side looks."""
        return self.rotation.get_right_vector()


@dataclass
class VehicleControl:
    """The command for one tick: throttle 0..1, steer -1..1, brake 0..1."""

    throttle: float = 0.0
    steer: float = 0.0
    brake: float = 0.0
    hand_brake: bool = False
    reverse: bool = False
    manual_gear_shift: bool = False
    gear: int = 0


_PLAN_GAP_M = 50.0
"""As in Bench2Drive (`leaderboard/autoagents/autonomous_agent.py`); the leaderboard keeps a point every 200 m."""


class RoadOption(IntEnum):
    """CARLA's navigation commands, with its names and numbers."""

    VOID = -1
    LEFT = 1
    RIGHT = 2
    STRAIGHT = 3
    LANEFOLLOW = 4
    CHANGELANELEFT = 5
    CHANGELANERIGHT = 6


class Track(Enum):
    """The inputs that an agent may use; `MAP` adds the map to the sensors."""

    SENSORS = "SENSORS"
    MAP = "MAP"
    SENSORS_QUALIFIER = "SENSORS_QUALIFIER"
    MAP_QUALIFIER = "MAP_QUALIFIER"


class SensorConfigurationInvalid(Exception):  # noqa: N818 - the leaderboard's name
    """An agent asks for sensors that it may not have."""


class SensorReceivedNoData(Exception):  # noqa: N818 - the leaderboard's name
    """A sensor delivers nothing."""


class AutonomousAgent:
    """The base class of official agents."""

    def __init__(self, carla_host: str, carla_port: int, debug: bool = False) -> None:
        self.track = Track.SENSORS
        self._global_plan: Any = None
        self._global_plan_world_coord: Any = None
        self._plan_gps_HACK: Any = None
        self.hero_actor: Any = None
        self.wallclock_t0: Any = None

    def setup(self, path_to_conf_file: str) -> None:
        """Get ready for a route; `path_to_conf_file` is what follows the agent file's `+`."""

    def sensors(self) -> list[dict[str, Any]]:
        """Return the sensors of the vehicle."""
        return []

    def run_step(self, input_data: dict[str, Any], timestamp: float) -> Any:
        """Return the `carla.VehicleControl` for this tick; the base class returns a neutral one."""
        carla: Any = importlib.import_module("carla")
        return carla.VehicleControl()

    def destroy(self) -> None:
        """Free the resources of `setup`."""

    def get_hero(self) -> None:
        """Look up the vehicle (Bench2Drive's method). The adapter has set `hero_actor` already."""

    def get_metric_info(self) -> dict[str, list[float]]:
        """Return the motion for Bench2Drive's comfort metric: lists of numbers in the world's frame."""
        hero = self.hero_actor
        transform = hero.get_transform()
        turned = transform.rotation
        vectors = {
            "acceleration": hero.get_acceleration(),
            "angular_velocity": hero.get_angular_velocity(),
            "forward_vector": transform.get_forward_vector(),
            "right_vector": transform.get_right_vector(),
            "location": transform.location,
        }
        told = {name: [vector.x, vector.y, vector.z] for name, vector in vectors.items()}
        return {**told, "rotation": [turned.roll, turned.pitch, turned.yaw]}

    def set_global_plan(self, global_plan_gps: list[Any], global_plan_world_coord: list[Any]) -> None:
        """Keep a downsampled plan, and the dense one as `_plan_gps_HACK`."""
        kept = downsample_route(global_plan_world_coord, _PLAN_GAP_M)
        self._global_plan_world_coord = [(global_plan_world_coord[k][0], global_plan_world_coord[k][1]) for k in kept]
        self._global_plan = [global_plan_gps[k] for k in kept]
        self._plan_gps_HACK = global_plan_gps


def downsample_route(route: Sequence[tuple[Any, Any]], sample_factor: float) -> list[int]:
    """Return the indices of the points to keep of `[(transform, RoadOption), ...]`.

    Kept are all points of lane changes, points with another command than the point before (unless that is a lane
    change), a point whenever more than `sample_factor` metres went by since the last kept point, and the last point.
    """
    lane_changes = (RoadOption.CHANGELANELEFT.value, RoadOption.CHANGELANERIGHT.value)
    kept: list[int] = []
    since_m = 0.0
    for number, (transform, command) in enumerate(route):
        if number > 0:
            since_m += transform.location.distance(route[number - 1][0].location)
        before = route[number - 1][1].value if number > 0 else None
        changing = command.value in lane_changes
        changed = before != command.value and before not in lane_changes
        if changing or changed or since_m > sample_factor or number == len(route) - 1:
            kept.append(number)
            since_m = 0.0
    return kept


class CarlaDataProvider:
    """The world of the episode, as the adapter sets it: see `pytest_drive_robust.bench2drive.agents.carla_world`."""

    _world: ClassVar[Any] = None

    @staticmethod
    def get_world() -> Any:
        """Return the world of the episode, which has `get_actors`."""
        return CarlaDataProvider._world

    @staticmethod
    def get_hero_actor() -> Any:
        """Return the vehicle that the agent drives."""
        return CarlaDataProvider._world.hero


class GameTime:
    """Seconds since the start of the route and the number of the frame. The adapter sets both before every step."""

    _current_game_time: ClassVar[float] = 0.0
    _last_frame: ClassVar[int] = 0

    @staticmethod
    def get_time() -> float:
        """Return simulated seconds since the start of the route."""
        return GameTime._current_game_time

    get_carla_time = get_time  # our worlds start with the route

    @staticmethod
    def get_frame() -> int:
        """Return the number of the frame of `input_data`."""
        return GameTime._last_frame

    @staticmethod
    def get_wallclocktime() -> datetime.datetime:
        """Return the time of day on this computer."""
        return datetime.datetime.now()
