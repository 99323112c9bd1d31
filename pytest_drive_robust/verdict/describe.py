"""What happened in an episode, in a few words: `"completed, red light at 8.2 s"`."""

from __future__ import annotations

from collections.abc import Mapping

from pytest_drive_robust.domain.outcome import End, Infraction, InfractionKind
from pytest_drive_robust.domain.result import EpisodeResult

__all__ = ["describe_outcome"]

_ENDS: Mapping[End, str] = {
    End.COMPLETED: "completed",
    End.DEVIATED: "off the route",
    End.BLOCKED: "blocked",
    End.TICK_CAP: "out of time",
    End.STUCK: "stuck",
    End.ENVIRONMENT: "ended by the environment",
    End.AGENT_CRASHED: "agent error",
    End.AGENT_CRASHED_HARD: "agent crashed the process",
    End.AGENT_TIMED_OUT: "agent timed out",
    End.SIMULATION_CRASHED: "simulation crashed",
}
_BROKEN = frozenset({End.AGENT_CRASHED, End.AGENT_CRASHED_HARD, End.AGENT_TIMED_OUT, End.SIMULATION_CRASHED})
_EVENTS: Mapping[InfractionKind, str] = {
    InfractionKind.COLLISION_PEDESTRIAN: "collision with pedestrian",
    InfractionKind.COLLISION_VEHICLE: "collision with vehicle",
    InfractionKind.COLLISION_LAYOUT: "collision with obstacle",
    InfractionKind.RED_LIGHT: "red light",
    InfractionKind.STOP_SIGN: "stop sign",
    InfractionKind.YIELD_EMERGENCY: "did not yield",
    InfractionKind.SCENARIO_TIMEOUT: "scenario out of time",
    InfractionKind.OUTSIDE_LANES: "outside the lanes",
}
"""The kinds that are missing end the route, which `_ENDS` says, or cost nothing (minimum speed)."""


def describe_outcome(result: EpisodeResult) -> str:
    """How the episode ended and its first infraction, with their seconds.

    `"completed, red light at 8.2 s"`, `"collision with vehicle at 11.3 s and 1 more, blocked at 61.0 s"`.
    """
    events = sorted((event for event in result.infractions if event.kind in _EVENTS), key=lambda event: event.tick)
    first = _first(events, result.dt_s)
    end = _ENDS[result.end]
    if result.end is End.COMPLETED:
        return f"{end}, {first}" if first else end
    end = f"{end} at {result.game_s:.1f} s"
    if result.end in _BROKEN:
        end += f" ({result.end_detail})"
    return f"{first}, {end}" if first else end


def _first(events: list[Infraction], dt_s: float) -> str:
    if not events:
        return ""
    event = events[0]
    share = f" for {event.share_pct:.0f} % of the way" if event.kind is InfractionKind.OUTSIDE_LANES else ""
    more = f" and {len(events) - 1} more" if len(events) > 1 else ""
    when = "" if share else f" at {event.tick * dt_s:.1f} s"
    return f"{_EVENTS[event.kind]}{share}{when}{more}"
