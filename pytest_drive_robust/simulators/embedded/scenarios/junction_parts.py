"""What several scenario types share: the flow of the route file, lights in turn, the point where two ways meet."""

from __future__ import annotations

from contextlib import suppress

import numpy as np

from pytest_drive_robust.arithmetic import arrays
from pytest_drive_robust.domain.truth import ActorKind, LightState
from pytest_drive_robust.errors import RouteError
from pytest_drive_robust.simulators.embedded import state as c
from pytest_drive_robust.simulators.embedded.signals import Program, green_then_red, red_then_green
from pytest_drive_robust.simulators.embedded.stage import Stage

__all__ = [
    "RED_S",
    "cross_traffic",
    "end_behind_junction",
    "lights_turn_green",
    "lights_turn_red",
    "meeting_point",
    "route_end_ahead_m",
    "route_flow",
]

RED_S = 5.0
"""How long lights stay red (or green) after the scenario started."""

_YELLOW_S = 2.0
"""Long enough that everybody at town speeds can stop before the line or be past it."""
_ALL_RED_S = 1.0
_MEET_M = 1.0
_SLOWEST_MPS, _ACROSS_S = 4.0, 8.0
"""Who comes this slowly, and needs so long to start and to get across, finds no longer gap than who comes fast."""
_CARS = (ActorKind.CAR, ActorKind.VAN, ActorKind.CAR)


def route_flow(
    stage: Stage,
    path: int,
    *,
    speed_mps: tuple[float, float],
    gap_m: tuple[float, float],
    meets_ahead_m: float,
    kinds: tuple[ActorKind, ...] = _CARS,
) -> None:
    """Add the flow of the route file: `flow_speed`, gaps from `source_dist_interval`, from edge to edge of the town.

    `speed_mps` and `gap_m` are the type's ranges; they stand in for what the file leaves out. Its drivers keep their
    speed and give way to nobody, as Bench2Drive's do (`scenario_runner/srunner/scenariomanager/scenarioatomics/
    atomic_behaviors.py`, `ActorFlow`), until one of them has been hit; then all see what is ahead. Who comes to
    `meets_ahead_m` without waiting, however slowly, finds no gap longer than those drawn.
    """
    gaps = (
        stage.spec.number("source_dist_interval", gap_m[0], attribute="from"),
        stage.spec.number("source_dist_interval", gap_m[1], attribute="to"),
    )
    speed = stage.spec.number("flow_speed", (speed_mps[0] + speed_mps[1]) / 2.0)
    dense_s = (stage.trigger_m + meets_ahead_m) / _SLOWEST_MPS + _ACROSS_S
    dense_m = stage.length_m(path) - stage.along(path, meets_ahead_m) + dense_s * speed
    stage.flow(path, speed_mps=speed, gap_m=(min(gaps), max(gaps)), kinds=kinds, sees=c.SEES_NOBODY, dense_m=dense_m)


def cross_traffic(stage: Stage, *, gap_m: tuple[float, float] = (15.0, 30.0), lights: bool = False) -> None:
    """Add background traffic straight on from the junction's other arms, as fast as the ego's way through allows.

    Bench2Drive's sources at a junction send the next car once the last one is 15 m away
    (`scenario_runner/srunner/scenarios/background_activity.py`).

    Without `lights` the two roads would block each other: then there is oncoming traffic only where nobody crosses.
    """
    inside = stage.lane_at(stage.junction_ahead_m() + 1.0)
    speed = 0.8 * min(stage.speed_limit_mps, inside.speed_limit_mps)
    crossed = False
    for bearing in ("left", "right", "opposite"):
        if bearing == "opposite" and crossed and not lights:
            break
        with suppress(RouteError):  # a junction of three arms lacks one of them
            stage.flow(
                stage.from_arm(bearing), speed_mps=speed, gap_m=gap_m, background=True, obeys_lights=lights,
                sees=c.SEES_LATE,
            )  # fmt: skip
            crossed = True


def lights_turn_green(stage: Stage, *, red_s: float = RED_S) -> None:
    """Show red along the ego's road, then green; the crossing road has green before that."""
    own = red_then_green(red_s)
    stage.lights(ego=own, opposite=own, crossing=_green_between(0.0, max(red_s - _ALL_RED_S - _YELLOW_S, 0.0)))


def lights_turn_red(stage: Stage, *, green_s: float = RED_S, red_s: float = RED_S) -> None:
    """Show green along the ego's road, then red, while the crossing road has its green, then green again."""
    red_at = green_s + _YELLOW_S
    own = green_then_red(green_s, red_s)
    between = _green_between(red_at + _ALL_RED_S, red_at + max(red_s - _ALL_RED_S - _YELLOW_S, 2.0 * _ALL_RED_S))
    stage.lights(ego=own, opposite=own, crossing=between)


def _green_between(start_s: float, end_s: float) -> Program:
    """Return a program that is red but for one green, which a yellow ends."""
    return Program(
        LightState.RED if start_s > 0.0 else LightState.GREEN,
        (
            (LightState.RED, start_s),
            (LightState.GREEN, end_s),
            (LightState.YELLOW, end_s + _YELLOW_S),
            (LightState.RED, np.inf),
        ),
    )


def meeting_point(stage: Stage, path: int, *, within_m: float = _MEET_M) -> tuple[float, float] | None:
    """Return (metres ahead on the ego's way, metres along `path`) where they first meet within the junction, or None.

    They meet where they are nearer than `within_m`; with an infinite distance where they are nearest.
    """
    ahead = np.arange(stage.junction_ahead_m() - 2.0, stage.exit_ahead_m() + 2.0, 0.5)
    places = np.array([stage.spot(float(a)) for a in ahead])
    line = stage.paths[path]
    away = arrays.hypot(line[None, :, 0] - places[:, :1], line[None, :, 1] - places[:, 1:])
    nearest = away.min(axis=1)
    met = np.flatnonzero(nearest <= nearest.min() if np.isinf(within_m) else nearest < within_m)
    if len(met) == 0:
        return None
    at = float(ahead[met[0]])
    return at, stage.along(path, at)


def end_behind_junction(stage: Stage, *, metres: float = 15.0) -> None:
    """End the scenario once the ego has left its first junction so far behind."""
    stage.end_m = stage.trigger_m + stage.exit_ahead_m() + metres


def route_end_ahead_m(stage: Stage) -> float:
    """Return the metres from the trigger to the end of the route."""
    return stage.dense.length_m - stage.trigger_m
