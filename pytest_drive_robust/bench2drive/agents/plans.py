"""A plan as `set_global_plan` of the leaderboard's agents wants it: GPS dictionaries, and transforms with commands."""

from __future__ import annotations

import importlib
import math
from typing import Any

from pytest_drive_robust.domain.route import GlobalPlan, PlanPoint, RoadOption

__all__ = ["STRAIGHT_PLAN", "WorldPlan", "gps_plan", "world_plan"]

WorldPlan = list[tuple[Any, Any]]
"""Return `(carla.Transform, RoadOption)` for every metre of the way."""

STRAIGHT_PLAN = GlobalPlan(
    tuple(PlanPoint(x, 0.0, RoadOption.LANE_FOLLOW) for x in (0.0, 50.0, 100.0)),
    tuple(PlanPoint(float(x), 0.0, RoadOption.LANE_FOLLOW) for x in range(101)),
)
"""Hundred metres straight on: what an agent is set up with before there is a route, to see its sensors."""


def gps_plan(plan: GlobalPlan) -> list[tuple[dict[str, float], Any]]:
    """Return `({"lat": ..., "lon": ..., "z": 0.0}, RoadOption)` for every point of the dense plan, degrees."""
    options = _options()
    return [
        ({"lat": point.latitude_deg, "lon": point.longitude_deg, "z": 0.0}, options(int(point.command)))
        for point in _points(plan)
    ]


def world_plan(plan: GlobalPlan) -> WorldPlan:
    """Return `(carla.Transform, RoadOption)` for every point of the dense plan, each turned to the next one."""
    carla: Any = importlib.import_module("carla")
    options = _options()
    points = _points(plan)
    found: WorldPlan = []
    for number, point in enumerate(points):
        here, there = (point, points[number + 1]) if number + 1 < len(points) else (points[max(number - 1, 0)], point)
        yaw_deg = math.degrees(math.atan2(there.y_m - here.y_m, there.x_m - here.x_m))
        place = carla.Location(x=point.x_m, y=point.y_m, z=0.0)
        turned = carla.Rotation(pitch=0.0, yaw=yaw_deg, roll=0.0)
        found.append((carla.Transform(place, turned), options(int(point.command))))
    return found


def _points(plan: GlobalPlan) -> tuple[PlanPoint, ...]:
    return plan.dense or plan.points


def _options() -> Any:
    """Return CARLA's own enumeration where its Python API is there, else ours: agents compare with what they import."""
    return importlib.import_module("agents.navigation.local_planner").RoadOption
