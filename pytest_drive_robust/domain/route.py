"""Where to drive: a route as in the CARLA leaderboard's route XML, and the sparse plan of the route for an agent."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import IntEnum

from pytest_drive_robust.domain.geodesy import GeodeticPlace

_TURN_RAD = math.radians(35.0)
_MAX_GAP_M = 50.0


class RoadOption(IntEnum):
    """The leaderboard's navigation commands, with its numbers."""

    LEFT = 1
    RIGHT = 2
    STRAIGHT = 3
    LANE_FOLLOW = 4
    CHANGE_LANE_LEFT = 5
    CHANGE_LANE_RIGHT = 6

    @classmethod
    def through_junction(cls, turn_rad: float) -> RoadOption:
        """Return the command for a way through a junction that turns by `turn_rad`, positive to the right."""
        if abs(turn_rad) < _TURN_RAD:
            return cls.STRAIGHT
        return cls.RIGHT if turn_rad > 0.0 else cls.LEFT


@dataclass(frozen=True, slots=True)
class Waypoint:
    """A key point of the route, metres in the town's frame."""

    x_m: float
    y_m: float
    z_m: float = 0.0


@dataclass(frozen=True, slots=True)
class TriggerPoint:
    """Where the scenario starts: metres and degrees (clockwise from east) in the town's frame."""

    x_m: float
    y_m: float
    z_m: float
    yaw_deg: float


@dataclass(frozen=True, slots=True)
class ScenarioSpec:
    """One scripted situation.

    `parameters` maps each child element of the XML (`distance`, `flow_speed`, `source_dist_interval`, ...) to its
    attributes as numbers: `{"distance": {"value": 45.0}, "source_dist_interval": {"from": 15.0, "to": 28.0}}`.
    Attributes that are no numbers (`direction`, `blocker_model`) are kept in `texts`.
    """

    name: str
    type: str
    trigger: TriggerPoint
    parameters: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    texts: Mapping[str, str] = field(default_factory=dict)

    def number(self, element: str, default: float, *, attribute: str = "value") -> float:
        """Return the number of a parameter element, or the scenario type's default."""
        return self.parameters.get(element, {}).get(attribute, default)


@dataclass(frozen=True, slots=True)
class Weather:
    """CARLA's weather attributes: percentages 0..100, sun angles in degrees (altitude below 0 is night)."""

    cloudiness: float = 5.0
    precipitation: float = 0.0
    precipitation_deposits: float = 0.0
    wetness: float = 0.0
    wind_intensity: float = 10.0
    sun_azimuth_angle: float = -1.0
    sun_altitude_angle: float = 45.0
    fog_density: float = 2.0


@dataclass(frozen=True, slots=True)
class Route:
    """One route of a route file. `id` is unique within a file; `town` names the map."""

    id: str
    town: str
    waypoints: tuple[Waypoint, ...]
    scenario: ScenarioSpec
    weather: Weather = Weather()

    @property
    def label(self) -> str:
        """The id and the scenario type: `"2091 NonSignalizedJunctionLeftTurn"`."""
        return f"{self.id} {self.scenario.type}"


@dataclass(frozen=True, slots=True)
class PlanPoint(GeodeticPlace):
    """One point of the sparse plan: metres in the route's frame and the command that holds from here on."""

    x_m: float
    y_m: float
    command: RoadOption


@dataclass(frozen=True, slots=True)
class GlobalPlan:
    """The plan that `Agent.reset` gets: the points that CARLA's `set_global_plan` gives, and no more.

    `points` are the points where the command changes, every lane change, and at least one point every 50 m
    (Bench2Drive `leaderboard/autoagents/autonomous_agent.py`).

    `dense` is the way that `points` were taken from, about one point per metre, with a first and a last point for each
    lane change; empty where a simulator does not tell it. The leaderboard gives both to its agents.
    """

    points: tuple[PlanPoint, ...]
    dense: tuple[PlanPoint, ...] = field(default=(), repr=False)

    @classmethod
    def of(cls, way: Sequence[PlanPoint], s_m: Sequence[float], dense: tuple[PlanPoint, ...] = ()) -> GlobalPlan:
        """Return the plan of `way`, a point about every metre; `s_m` are the points' distances along the way."""
        points: list[PlanPoint] = []
        last_m = -math.inf
        for point, at_m in zip(way, s_m, strict=True):
            changed = not points or point.command is not points[-1].command
            if changed or at_m - last_m >= _MAX_GAP_M or point is way[-1]:
                points.append(point)
                last_m = at_m
        return cls(tuple(points), dense)
