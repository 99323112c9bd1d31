"""CARLA's world as far as we show it to an agent: the clock, and the agent's own vehicle as its sensors measure it.

Bench2Drive's agents log how their `hero_actor` moves. Other actors, map, lights and signs are not there.
"""

from __future__ import annotations

import fnmatch
import importlib
import math
import sys
from typing import Any

from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.observation import Observation

_PROVIDER = "srunner.scenariomanager.carla_data_provider"
_CLOCK = "srunner.scenariomanager.timer"


def _carla() -> Any:
    return importlib.import_module("carla")


class Hero:
    """The vehicle that the agent drives, with the methods of CARLA's vehicles."""

    id = 0
    type_id = "vehicle.lincoln.mkz_2020"
    is_alive = True

    def __init__(self) -> None:
        self.attributes = {"role_name": "hero"}
        self.command = Control.NEUTRAL
        self._place = (0.0, 0.0, 0.0)  # x and y in metres, yaw in radians
        self._speed_mps = self._yaw_rate_radps = 0.0
        self._acceleration = (0.0, 0.0)  # forward and to the right, m/s2

    def see(self, seen: Observation) -> None:
        """Take place, speed and acceleration from an observation."""
        self._place = (seen.gps.x_m, seen.gps.y_m, seen.compass.yaw_rad)
        self._speed_mps, self._yaw_rate_radps = seen.speed.mps, seen.imu.yaw_rate_radps
        self._acceleration = (seen.imu.forward_mps2, seen.imu.right_mps2)

    def get_transform(self) -> Any:
        """Return the place and the rotation as a `carla.Transform`, metres and degrees."""
        x_m, y_m, yaw = self._place
        carla = _carla()
        turned = carla.Rotation(pitch=0.0, yaw=math.degrees(yaw), roll=0.0)
        return carla.Transform(carla.Location(x=x_m, y=y_m, z=0.0), turned)

    def get_location(self) -> Any:
        """Return the place as a `carla.Location`, metres."""
        return self.get_transform().location

    def get_velocity(self) -> Any:
        """Return the velocity in metres per second, in the world's axes."""
        return self._in_world(self._speed_mps, 0.0)

    def get_acceleration(self) -> Any:
        """Return the acceleration in metres per second squared, in the world's axes."""
        return self._in_world(*self._acceleration)

    def get_angular_velocity(self) -> Any:
        """Return the angular velocity in degrees per second, as CARLA does."""
        return _carla().Vector3D(x=0.0, y=0.0, z=math.degrees(self._yaw_rate_radps))

    def get_control(self) -> Any:
        """Return the command of the last tick."""
        given = self.command
        return _carla().VehicleControl(throttle=given.throttle, steer=given.steer, brake=given.brake)

    def _in_world(self, forward: float, right: float) -> Any:
        cos, sin = math.cos(self._place[2]), math.sin(self._place[2])
        return _carla().Vector3D(x=forward * cos - right * sin, y=forward * sin + right * cos, z=0.0)


class ActorList(list[Hero]):
    """A list of actors with CARLA's filter by type: `filter("*vehicle*")`."""

    def filter(self, pattern: str) -> ActorList:
        """Return the actors whose type matches the pattern."""
        return ActorList(actor for actor in self if fnmatch.fnmatch(actor.type_id, pattern))


class HeroWorld:
    """The world of one episode, as `CarlaDataProvider.get_world()` gives it."""

    def __init__(self) -> None:
        self.hero = Hero()

    def get_actors(self) -> ActorList:
        """Return a list of one actor, the agent's own vehicle."""
        return ActorList([self.hero])


def show_world(world: HeroWorld, *, frame: int, time_s: float) -> None:
    """Set the clock and the world for the agent, in those modules of `srunner` that are imported.

    `time_s` is seconds since the start of the route, `frame` the number of the frame.
    """
    clock = getattr(sys.modules.get(_CLOCK), "GameTime", None)
    if clock is not None:
        clock._current_game_time, clock._last_frame = time_s, frame
    provider = getattr(sys.modules.get(_PROVIDER), "CarlaDataProvider", None)
    if provider is not None and provider._world is not world:
        provider._world = world
