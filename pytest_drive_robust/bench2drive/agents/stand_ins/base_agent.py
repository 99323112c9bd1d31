"""Stands in for `leaderboard.autoagents.autonomous_agent`: the base class of every agent of the leaderboard."""

from __future__ import annotations

import importlib
from enum import Enum
from typing import Any

from pytest_drive_robust.bench2drive.agents.stand_ins.downsampling import downsample_route

__all__ = ["AutonomousAgent", "Track"]

_PLAN_GAP_M = 50.0
"""As in Bench2Drive (`leaderboard/autoagents/autonomous_agent.py`); the leaderboard itself keeps one every 200 m."""


class Track(Enum):
    """What an agent may use; `MAP` adds the map to the sensors."""

    SENSORS = "SENSORS"
    MAP = "MAP"
    SENSORS_QUALIFIER = "SENSORS_QUALIFIER"
    MAP_QUALIFIER = "MAP_QUALIFIER"


class AutonomousAgent:
    """What an agent file derives its class from."""

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
        """Return the `carla.VehicleControl` for this tick: here one that does nothing."""
        carla: Any = importlib.import_module("carla")
        return carla.VehicleControl()

    def destroy(self) -> None:
        """Give back what `setup` took."""

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
        """Keep those points of the dense route that tell the way."""
        kept = downsample_route(global_plan_world_coord, _PLAN_GAP_M)
        self._global_plan_world_coord = [(global_plan_world_coord[k][0], global_plan_world_coord[k][1]) for k in kept]
        self._global_plan = [global_plan_gps[k] for k in kept]
        self._plan_gps_HACK = global_plan_gps
