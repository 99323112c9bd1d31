"""How an episode ended, and what went wrong on the way."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


class Outcome(str, Enum):
    """Who caused the end of the episode."""

    COMPLETED = "completed"
    """The route was driven to its end (perhaps with infractions)."""
    FAILED = "failed"
    """The agent did not reach the end: blocked, off the route, out of time."""
    AGENT_ERROR = "agent_error"
    """The agent broke its contract: exception, NaN, wrong type. Scored like a failure, listed apart."""
    INFRA_ERROR = "infra_error"
    """This package or the simulator failed. Never scored."""


class End(str, Enum):
    """What ended the episode, with Bench2Drive's status strings where one exists."""

    COMPLETED = "Completed"
    DEVIATED = "Failed - Agent deviated from the route"
    BLOCKED = "Failed - Agent got blocked"
    TICK_CAP = "Failed - TickRuntime"
    STUCK = "Failed - Stuck (early stop)"
    ENVIRONMENT = "Failed - Environment ended the episode"
    AGENT_CRASHED = "Failed - Agent crashed"
    AGENT_CRASHED_HARD = "Failed - Agent crashed the process"
    AGENT_TIMED_OUT = "Failed - Agent timed out"
    SIMULATION_CRASHED = "Failed - Simulation crashed"


class InfractionKind(str, Enum):
    """The infraction lists of a leaderboard record, by their JSON names (bench2drive `statistics_manager.py`)."""

    COLLISION_PEDESTRIAN = "collisions_pedestrian"
    COLLISION_VEHICLE = "collisions_vehicle"
    COLLISION_LAYOUT = "collisions_layout"
    RED_LIGHT = "red_light"
    STOP_SIGN = "stop_infraction"
    YIELD_EMERGENCY = "yield_emergency_vehicle_infractions"
    SCENARIO_TIMEOUT = "scenario_timeouts"
    OUTSIDE_LANES = "outside_route_lanes"
    MIN_SPEED = "min_speed_infractions"
    DEVIATION = "route_dev"
    BLOCKED = "vehicle_blocked"
    ROUTE_TIMEOUT = "route_timeout"


@dataclass(frozen=True, slots=True)
class Infraction:
    """One event of one tick. `detail` is a sentence for people: `"hit car 7 at 4.2 m/s"`.

    `share_pct` is the percentage of the travelled route for `OUTSIDE_LANES`, the ego's speed in percent of the
    traffic's for `MIN_SPEED`, and 0 for the others.
    """

    kind: InfractionKind
    tick: int
    detail: str
    x_m: float = 0.0
    y_m: float = 0.0
    share_pct: float = 0.0
