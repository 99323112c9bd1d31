"""What an agent finds that asks CARLA's world: its own vehicle, the others around it, and the map.

Official agents may read `CarlaDataProvider.get_world()`, and Bench2Drive's write down how their `hero_actor` moved. The
vehicle is where the ground truth puts it for agents that are given it (an agent file that imports `CarlaDataProvider`
is), and where the sensors put it for all others. Nothing here changes the world.
"""

from __future__ import annotations

import fnmatch
import functools
import importlib
import math
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from pytest_drive_robust.bench2drive.agents.opendrive import opendrive_of
from pytest_drive_robust.bench2drive.agents.stand_ins.finder import is_stand_in
from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.truth import ActorKind, WorldState

if TYPE_CHECKING:
    from pytest_drive_robust.domain.observation import Observation
    from pytest_drive_robust.domain.truth import GroundTruth, LaneMap

__all__ = ["Actor", "ActorList", "SeenWorld", "show_world"]

_HERO_ID = 0
_HERO_HEIGHT_M = 1.5
_KINDS = {
    ActorKind.PEDESTRIAN: "walker.pedestrian.0001",
    ActorKind.CONE: "static.prop.trafficcone01",
    ActorKind.BARRIER: "static.prop.streetbarrier",
    ActorKind.CONTAINER: "static.prop.container",
    ActorKind.WARNING_SIGN: "static.prop.trafficwarning",
    ActorKind.BUILDING: "static.building",
    ActorKind.DOOR: "static.prop.door",
    ActorKind.DIRT: "static.prop.dirtdebris01",
    ActorKind.BICYCLE: "vehicle.bh.crossbike",
    ActorKind.EMERGENCY: "vehicle.dodge.charger_police_2020",
}
_PROVIDER = "srunner.scenariomanager.carla_data_provider"
_CLOCK = "srunner.scenariomanager.timer"


def _carla() -> Any:
    return importlib.import_module("carla")


@dataclass
class Actor:
    """One vehicle, walker or thing with CARLA's questions. The hero is filled anew in every tick."""

    id: int
    type_id: str
    attributes: dict[str, str] = field(default_factory=dict)
    place: tuple[float, float, float] = (0.0, 0.0, 0.0)  # x and y in metres, yaw in radians
    speed_mps: float = 0.0
    acceleration: tuple[float, float] = (0.0, 0.0)  # forward and to the right, m/s2
    yaw_rate_radps: float = 0.0
    size_m: tuple[float, float, float] = (4.9, 1.84, _HERO_HEIGHT_M)
    command: Control = Control.NEUTRAL
    world: SeenWorld | None = None
    is_alive: bool = True

    def get_transform(self) -> Any:
        """Return where it stands and how."""
        x_m, y_m, yaw = self.place
        carla = _carla()
        return carla.Transform(
            carla.Location(x=x_m, y=y_m, z=0.0), carla.Rotation(pitch=0.0, yaw=math.degrees(yaw), roll=0.0)
        )

    def get_location(self) -> Any:
        """Return where it stands."""
        return self.get_transform().location

    def get_velocity(self) -> Any:
        """Return metres per second in the world's axes."""
        return self._turned(self.speed_mps, 0.0)

    def get_acceleration(self) -> Any:
        """Return metres per second squared in the world's axes."""
        return self._turned(*self.acceleration)

    def get_angular_velocity(self) -> Any:
        """Return degrees per second, as CARLA gives it."""
        return _carla().Vector3D(x=0.0, y=0.0, z=math.degrees(self.yaw_rate_radps))

    def get_control(self) -> Any:
        """Return the command of the last tick."""
        given = self.command
        return _carla().VehicleControl(throttle=given.throttle, steer=given.steer, brake=given.brake)

    @property
    def bounding_box(self) -> Any:
        """Half its size, around its middle."""
        carla = _carla()
        length, width, height = (0.5 * side for side in self.size_m)
        return carla.BoundingBox(carla.Location(x=0.0, y=0.0, z=height), carla.Vector3D(x=length, y=width, z=height))

    def get_world(self) -> SeenWorld:
        """Return the world that it is in."""
        assert self.world is not None  # every world gives itself to its actors
        return self.world

    def get_speed_limit(self) -> float:
        """Return kilometres per hour."""
        return 3.6 * self.get_world().speed_limit_mps()

    def _turned(self, forward: float, right: float) -> Any:
        cos, sin = math.cos(self.place[2]), math.sin(self.place[2])
        return _carla().Vector3D(x=forward * cos - right * sin, y=forward * sin + right * cos, z=0.0)


class ActorList(Sequence[Actor]):
    """Actors that can be filtered by their type as CARLA's can: `filter("*vehicle*")`."""

    def __init__(self, actors: Sequence[Actor]) -> None:
        self._actors = tuple(actors)

    def filter(self, pattern: str) -> ActorList:
        """Return those whose type matches."""
        return ActorList([actor for actor in self._actors if fnmatch.fnmatch(actor.type_id, pattern)])

    def find(self, number: int) -> Actor | None:
        """Return the one of that id, or None."""
        return next((actor for actor in self._actors if actor.id == number), None)

    def __getitem__(self, index: Any) -> Any:
        return self._actors[index]

    def __len__(self) -> int:
        return len(self._actors)

    def __iter__(self) -> Iterator[Actor]:
        return iter(self._actors)


class SeenWorld:
    """The world of one episode, as `CarlaDataProvider.get_world()` gives it. It shows neither lights nor signs."""

    def __init__(self) -> None:
        self.hero = Actor(_HERO_ID, "vehicle.lincoln.mkz_2020", {"role_name": "hero"}, world=self)
        self._truth: GroundTruth | None = None

    def update(self, seen: Observation) -> None:
        """Show the moment of an observation."""
        self._truth, hero = seen.truth, self.hero
        if seen.truth is None:
            hero.place = (seen.gps.x_m, seen.gps.y_m, seen.compass.yaw_rad)
            hero.speed_mps = seen.speed.mps
            hero.acceleration = (seen.imu.forward_mps2, seen.imu.right_mps2)
            hero.yaw_rate_radps = seen.imu.yaw_rate_radps
            return
        ego = seen.truth.frame.ego
        hero.place = (ego.x_m, ego.y_m, ego.yaw_rad)
        hero.speed_mps = ego.speed_mps
        hero.acceleration = (ego.forward_mps2, ego.right_mps2)
        hero.yaw_rate_radps = ego.yaw_rate_radps
        hero.size_m = (ego.length_m, ego.width_m, _HERO_HEIGHT_M)

    def get_actors(self) -> ActorList:
        """Return the hero; with the ground truth also everybody else."""
        others = [] if self._truth is None else [self._actor(row) for row in self._truth.frame.actors.tolist()]
        return ActorList([self.hero, *others])

    def get_map(self) -> Any:
        """Return a real `carla.Map` of the roads here.

        Raises `RuntimeError` without the carla package or the ground truth."""
        if self._truth is None:
            raise RuntimeError("the map of the world is given only to agents whose file imports CarlaDataProvider")
        if is_stand_in(_carla()):
            raise RuntimeError("the map of the world is a carla.Map: install the carla package (pip install carla)")
        return _carla_map(_Known(self._truth.lane_map))

    def speed_limit_mps(self) -> float:
        """Return the limit where the hero drives; 0 where nothing is known of it."""
        return 0.0 if self._truth is None else float(self._truth.route[self._truth.progress, 3])

    def _actor(self, row: list[float]) -> Actor:
        kind = ActorKind(int(row[WorldState.KIND]))
        return Actor(
            int(row[WorldState.ID]) + 1,
            _KINDS.get(kind, f"vehicle.{kind.name.lower()}"),
            {"role_name": "scenario"},
            place=(row[WorldState.X], row[WorldState.Y], row[WorldState.YAW]),
            speed_mps=row[WorldState.SPEED],
            size_m=(row[WorldState.LENGTH], row[WorldState.WIDTH], row[WorldState.HEIGHT]),
            world=self,
        )


@dataclass(frozen=True, eq=False)
class _Known:
    """A lane map as a key: the same object is the same map."""

    lane_map: LaneMap

    def __hash__(self) -> int:
        return id(self.lane_map)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Known) and other.lane_map is self.lane_map


@functools.lru_cache(maxsize=4)
def _carla_map(known: _Known) -> Any:
    return _carla().Map(known.lane_map.name, opendrive_of(known.lane_map))


def show_world(world: SeenWorld, *, frame: int, time_s: float) -> None:
    """Set the clock and the world that the agent may look at, in whatever modules of `srunner` it has imported."""
    clock = getattr(sys.modules.get(_CLOCK), "GameTime", None)
    if clock is not None:
        clock._current_game_time, clock._last_frame = time_s, frame
    provider = getattr(sys.modules.get(_PROVIDER), "CarlaDataProvider", None)
    if provider is not None and provider._world is not world:
        provider._world, provider._map = world, None
