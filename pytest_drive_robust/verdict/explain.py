"""Describes episodes for people: how an episode ended, when the ego left its clean twin, and the worst routes."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from pytest_drive_robust.domain.outcome import End, Infraction, InfractionKind
from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.metrics.episodes import route_and_seed
from pytest_drive_robust.metrics.score import driving_score
from pytest_drive_robust.verdict.infraction_words import hit_words

_DISTANCE_M = 0.5
_SPEED_MPS = 1.0
_NOT_DRIVEN = "not driven"
_MOST_WORST = 3

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
"""The words for infractions. Missing kinds end the route, which `_ENDS` describes, or cost nothing (minimum speed)."""

PLACELESS = (InfractionKind.OUTSIDE_LANES, InfractionKind.MIN_SPEED)
"""The infractions without a place, because they are measured over the whole route."""


@dataclass(frozen=True, slots=True)
class WorstRoute:
    """One episode under the setting beside its clean twin. Scores are driving scores, 0..100.

    `clean_score` is None and `clean_outcome` `"not driven"` when there is no clean twin. `diverged_s` is the second at
    which the two egos began to differ, None when they never did or there is no twin; `diverged_by` names the signal
    that differed. `clean_value` and `perturbed_value` are values of the metric that ranked the route, None when the
    driving score ranked it.
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
    clean_value: float | None = None
    perturbed_value: float | None = None


@dataclass(frozen=True, slots=True)
class Yardstick:
    """A limit on single episodes: `value` returns the metric of one episode, None without data."""

    value: Callable[[EpisodeResult], float | None]
    limit: float
    is_upper: bool

    def excess(self, result: EpisodeResult) -> float:
        """Return how far the value of an episode lies beyond the limit: above 0 when broken, 0 without data."""
        value = self.value(result)
        if value is None:
            return 0.0
        return value - self.limit if self.is_upper else self.limit - value


class Divergence(NamedTuple):
    """The `second` from the start at which two egos parted, and the `signal` that left its tolerance first.

    `signal` is `"in speed"`, `"in distance"` (ahead or behind), or `"sideways"`.
    """

    second: float
    signal: str


def worst_routes(
    clean: Sequence[EpisodeResult],
    perturbed: Sequence[EpisodeResult],
    *,
    relative: bool,
    yardstick: Yardstick | None = None,
) -> tuple[WorstRoute, ...]:
    """Return at most three routes, one episode each, the worst first.

    `yardstick` ranks episodes by how far their own value lies beyond the limit. Without a yardstick, or when no single
    episode breaks its limit, driving scores rank. With `relative`, episodes are ranked by the driving score lost
    against the clean twin, and routes that lost nothing are left out (every perturbed episode must have its twin).
    Otherwise episodes are ranked by the lowest driving score, and full scores are left out. Ties go by route and seed,
    so that the order is always the same.
    """
    twins = {route_and_seed(result): result for result in clean}

    def lost(result: EpisodeResult) -> float:
        return (driving_score(twins[route_and_seed(result)]) if relative else 100.0) - driving_score(result)

    value = yardstick.value if yardstick is not None else None
    worst = _furthest(perturbed, yardstick.excess) if yardstick is not None else []
    if not worst:
        value, worst = None, _furthest(perturbed, lost)
    return tuple(_explain(result, twins.get(route_and_seed(result)), value) for result in worst[:_MOST_WORST])


def _furthest(results: Sequence[EpisodeResult], excess: Callable[[EpisodeResult], float]) -> list[EpisodeResult]:
    """Return the episode with the largest excess of each route, if above 0, sorted by excess, the largest first."""
    ranked = sorted(
        ((-excess(result), *route_and_seed(result), result) for result in results), key=lambda entry: entry[:3]
    )
    worst: dict[str, EpisodeResult] = {}
    for distance, route_id, _, result in ranked:
        if distance < 0.0:
            worst.setdefault(route_id, result)
    return list(worst.values())


def describe_outcome(result: EpisodeResult) -> str:
    """Return how the episode ended and its first infraction, with their seconds as far as they are known.

    `"completed, red light at 8.2 s"`, `"hit van (30 km/h) at 11.3 s and 1 more, blocked at 61.0 s"`.
    """
    events = sorted((event for event in result.infractions if event.kind in _EVENTS), key=lambda event: event.tick)
    first = _first(events, result.dt_s)
    end = _ENDS[result.end]
    if result.end is End.COMPLETED:
        return f"{end}, {first}" if first else end
    end = f"{end} at {seconds_text(result.game_s)}"
    if result.end in _BROKEN:
        end += f" ({result.end_detail})"
    return f"{first}, {end}" if first else end


def why_rd_says_nothing(clean_score: float, floor: float) -> str:
    """Return why an RD says nothing, or an empty string: an agent that hardly drives has little to lose."""
    if clean_score >= floor:
        return ""
    return f"the clean driving score is {clean_score:.1f}, below the floor of {floor:g}: RD says nothing yet"


def infraction_s(item: Infraction, dt_s: float) -> float | None:
    """Return when an infraction happened, in seconds from the start, or None when unknown (tick 0).

    Official records of other tools do not tell the tick; our simulators count from tick 1.
    """
    return item.tick * dt_s if item.tick > 0 else None


def seconds_text(time_s: float) -> str:
    """Return a time of an episode as text, as in `"11.3 s"`; 7.25 and 7.2499999999, its rounded form, give equal text.

    >>> seconds_text(307 * 0.05), seconds_text(15.35), seconds_text(7.25)
    ('15.4 s', '15.4 s', '7.3 s')
    """
    return f"{math.floor(round(10.0 * time_s, 6) + 0.5) / 10.0:.1f} s"


def first_divergence(clean: EpisodeResult, perturbed: EpisodeResult) -> Divergence | None:
    """Return when and in which signal the two egos first differ, or None when they never differ.

    Two egos differ when, at the same tick, one ego is more than 0.5 m ahead of, behind or beside the other (in the
    frame of the clean ego) or more than 1 m/s faster or slower. Only the ticks that both episodes have are compared.
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


def _explain(
    result: EpisodeResult, twin: EpisodeResult | None, value: Callable[[EpisodeResult], float | None] | None
) -> WorstRoute:
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
        clean_value=None if twin is None or value is None else value(twin),
        perturbed_value=None if value is None else value(result),
    )


def _first(events: list[Infraction], dt_s: float) -> str:
    if not events:
        return ""
    event = events[0]
    share = f" for {event.share_pct:.0f} % of the way" if event.kind is InfractionKind.OUTSIDE_LANES else ""
    more = f" and {len(events) - 1} more" if len(events) > 1 else ""
    second = infraction_s(event, dt_s)
    when = "" if share or second is None else f" at {seconds_text(second)}"
    return f"{hit_words(event.detail) or _EVENTS[event.kind]}{share}{when}{more}"
