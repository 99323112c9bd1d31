"""What happened on a route, for people: how an episode ended, when it left its clean twin, where most was lost."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from pytest_drive_robust.domain.outcome import End, Infraction, InfractionKind
from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.metrics.score import driving_score

_DISTANCE_M = 0.5
_SPEED_MPS = 1.0
_NOT_DRIVEN = "not driven"

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

PLACELESS = (InfractionKind.OUTSIDE_LANES, InfractionKind.MIN_SPEED)
"""What is found only when the whole way is added up happened at no particular place."""


@dataclass(frozen=True, slots=True)
class WorstRoute:
    """One episode under the setting beside its clean twin. Scores are driving scores, 0..100.

    `clean_score` is None and `clean_outcome` `"not driven"` when there is no clean twin; `diverged_s` is the second at
    which the two began to differ, None when they never did or there is no twin; `diverged_by` says in what.
    """

    route_id: str
    scenario: str
    seed: int
    clean_score: float | None
    perturbed_score: float
    clean_outcome: str
    perturbed_outcome: str
    diverged_s: float | None
    diverged_by: str = ""


class Divergence(NamedTuple):
    """When two egos parted, seconds from the start, and what left its tolerance first.

    That is `"in speed"`, `"in distance"` along the way, or `"sideways"`."""

    second: float
    signal: str


def worst_routes(
    clean: Sequence[EpisodeResult], perturbed: Sequence[EpisodeResult], *, relative: bool, count: int = 3
) -> tuple[WorstRoute, ...]:
    """Return at most `count` routes, one episode each, the worst first.

    `relative`: by the driving score that was lost against the clean twin, routes that lost nothing left out (every
    perturbed episode must have its twin). Otherwise by the lowest driving score, full scores left out. Ties go by
    route and seed, so that the order is always the same.
    """
    twins = {(result.episode.route_id, result.episode.seed): result for result in clean}
    ranked: list[tuple[float, str, int, EpisodeResult]] = []
    for result in perturbed:
        route_id, seed = result.episode.route_id, result.episode.seed
        reference = driving_score(twins[route_id, seed]) if relative else 100.0
        loss = reference - driving_score(result)
        if loss > 0.0:
            ranked.append((-loss, route_id, seed, result))
    worst: dict[str, EpisodeResult] = {}
    for _, route_id, _, result in sorted(ranked, key=lambda entry: entry[:3]):
        worst.setdefault(route_id, result)
    chosen = list(worst.values())[:count]
    return tuple(_explain(result, twins.get((result.episode.route_id, result.episode.seed))) for result in chosen)


def describe_outcome(result: EpisodeResult) -> str:
    """Return how the episode ended and its first infraction, with their seconds.

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


def first_divergence(clean: EpisodeResult, perturbed: EpisodeResult) -> Divergence | None:
    """Return when the two egos differ for the first time and in what, or None when they never do.

    They differ when, at the same tick, one is more than 0.5 m ahead, behind or beside the other (in the frame of the
    clean ego) or more than 1 m/s faster or slower. Only the ticks that both episodes have are compared.
    """
    import numpy as np

    ticks = min(len(clean.trace.rows), len(perturbed.trace.rows))
    yaw, x_m, y_m, speed_mps = (clean.trace.column(name)[:ticks] for name in ("yaw_rad", "x_m", "y_m", "speed_mps"))
    east = perturbed.trace.column("x_m")[:ticks] - x_m
    south = perturbed.trace.column("y_m")[:ticks] - y_m
    ahead = np.cos(yaw) * east + np.sin(yaw) * south
    beside = np.cos(yaw) * south - np.sin(yaw) * east
    faster = perturbed.trace.column("speed_mps")[:ticks] - speed_mps
    signals = {
        "sideways": abs(beside) / _DISTANCE_M,
        "in speed": abs(faster) / _SPEED_MPS,
        "in distance": abs(ahead) / _DISTANCE_M,
    }
    apart = np.array(list(signals.values())) > 1.0
    if not bool(apart.any()):
        return None
    row = int(np.argmax(apart.any(axis=0)))
    first = max(signals, key=lambda name: float(signals[name][row]))
    return Divergence(float((row + 1) * clean.dt_s), first)  # a row of the trace is the end of its tick


def _explain(result: EpisodeResult, twin: EpisodeResult | None) -> WorstRoute:
    parted = None if twin is None else first_divergence(twin, result)
    return WorstRoute(
        route_id=result.episode.route_id,
        scenario=result.scenario,
        seed=result.episode.seed,
        clean_score=None if twin is None else driving_score(twin),
        perturbed_score=driving_score(result),
        clean_outcome=_NOT_DRIVEN if twin is None else describe_outcome(twin),
        perturbed_outcome=describe_outcome(result),
        diverged_s=None if parted is None else parted.second,
        diverged_by="" if parted is None else parted.signal,
    )


def _first(events: list[Infraction], dt_s: float) -> str:
    if not events:
        return ""
    event = events[0]
    share = f" for {event.share_pct:.0f} % of the way" if event.kind is InfractionKind.OUTSIDE_LANES else ""
    more = f" and {len(events) - 1} more" if len(events) > 1 else ""
    when = "" if share else f" at {event.tick * dt_s:.1f} s"
    return f"{_EVENTS[event.kind]}{share}{when}{more}"
