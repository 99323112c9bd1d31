"""What several scenario types share: numbers of the route file, traffic beside the route, flows, lights in turn."""

from __future__ import annotations

from contextlib import suppress

import numpy as np

from pytest_drive_robust.arithmetic import arrays
from pytest_drive_robust.arithmetic.random_numbers import Range
from pytest_drive_robust.arithmetic.signals import mean
from pytest_drive_robust.domain.truth import ActorKind, LaneKind
from pytest_drive_robust.errors import RouteError
from pytest_drive_robust.simulators.embedded import state as c
from pytest_drive_robust.simulators.embedded.light_programs import (
    YELLOW_S,
    green_between,
    green_then_red,
    red_then_green,
)
from pytest_drive_robust.simulators.embedded.map import lanes_across
from pytest_drive_robust.simulators.embedded.stage import CARS, Stage

KMH = 1.0 / 3.6
"""A kilometre per hour in metres per second."""

_FAST_MPS = 15.0
RED_S = 5.0
"""How long lights stay red (or green) after the scenario started."""
_ALL_RED_S = 1.0
_MEET_M = 1.0
_SLOWEST_MPS, _ACROSS_S = 4.0, 8.0
"""Who comes this slowly, and needs so long to start and to get across, finds no longer gap than who comes fast."""


def ahead(stage: Stage, default_m: float, *, at_least_m: float = 20.0) -> float:
    """Return metres from the trigger to what happens: the element `distance`, not so near that the ego starts in it."""
    return max(stage.spec.number("distance", default_m), at_least_m)


def speed(stage: Stage, element: str, default_kmh: float, *, at_least_kmh: float = 3.0) -> float:
    """Return an element that holds kilometres per hour, in metres per second; at most what a car can drive."""
    return min(max(stage.spec.number(element, default_kmh), at_least_kmh), 150.0) * KMH


def right_hand(stage: Stage) -> float:
    """Return 1 where things come from the right or stand there, -1 where the element `direction` is `left`."""
    return -1.0 if stage.spec.texts.get("direction") == "left" else 1.0


def road_edge_m(stage: Stage, side: str, ahead_m: float = 0.0) -> float:
    """Return metres from the middle of the ego's lane to the `"left"` or `"right"` kerb, across all lanes there."""
    own = stage.lane_at(ahead_m)
    away = own.width_m / 2.0
    for lane in lanes_across(stage.dense.lane_map.lanes, own, side):
        if lane.kind is LaneKind.SIDEWALK:
            break
        away += lane.width_m
    return away


def side_traffic(stage: Stage, default_kmh: float) -> None:
    """Use the lane to the left (the right one for obstacles to the left), at the element `speed`.

    Bench2Drive slows that lane down five seconds after the ego came near; ours has that speed all the time, and long
    gaps among the short ones (`scenario_runner/srunner/scenarios/route_obstacles.py`).
    """
    limit = min(speed(stage, "speed", default_kmh, at_least_kmh=10.0), stage.speed_limit_mps)
    beside = stage.beside("left" if right_hand(stage) > 0.0 else "right")
    stage.flow(beside, speed_mps=limit, gap_m=(35.0, 70.0), background=True)
    scenery(stage)


def oncoming_gaps(stage: Stage) -> None:
    """Let cars come the other way, with gaps from the element `frequency` (`from`, `to` or `value`)."""
    given = stage.spec.parameters.get("frequency", {})
    ends = [
        given.get(name, given.get("value", usual))
        for name, usual in zip(("from", "to"), stage.ranges["frequency"], strict=True)
    ]
    stage.flow(stage.oncoming(), speed_mps=0.8 * stage.speed_limit_mps, gap_m=(min(ends), max(ends)), background=True)


def scenery(stage: Stage, gap_m: Range = (45.0, 90.0)) -> None:
    """Add traffic the other way that only shares the road; a one-way road has none."""
    with suppress(RouteError):
        stage.flow(stage.oncoming(), speed_mps=0.8 * stage.speed_limit_mps, gap_m=gap_m, background=True)


def rolling_start(stage: Stage) -> float:
    """Start the ego at 70 % of the limit on fast roads, elsewhere at rest; return its speed in metres per second."""
    stage.start_mps = 0.7 * stage.speed_limit_mps if stage.speed_limit_mps > _FAST_MPS else 0.0
    return stage.start_mps


def route_flow(stage: Stage, path: int, *, meets_ahead_m: float, kinds: tuple[ActorKind, ...] = CARS) -> None:
    """Add the flow of the route file: `flow_speed`, gaps from `source_dist_interval`, from edge to edge of the town.

    The type's ranges stand in for what the file leaves out. Its drivers keep their speed and give way to nobody, as
    Bench2Drive's do (`scenario_runner/srunner/scenariomanager/scenarioatomics/atomic_behaviors.py`, `ActorFlow`), until
    one of them has been hit; then all see what is ahead. Who comes to `meets_ahead_m` without waiting, however slowly,
    finds no gap longer than those drawn.
    """
    gaps = [
        stage.spec.number("source_dist_interval", usual, attribute=end)
        for end, usual in zip(("from", "to"), stage.ranges["source_dist_interval"], strict=True)
    ]
    speed = stage.spec.number("flow_speed", mean(stage.ranges["flow_speed"]))
    dense_s = (stage.trigger_m + meets_ahead_m) / _SLOWEST_MPS + _ACROSS_S
    dense_m = stage.length_m(path) - stage.along(path, meets_ahead_m) + dense_s * speed
    stage.flow(path, speed_mps=speed, gap_m=(min(gaps), max(gaps)), kinds=kinds, sees=c.SEES_NOBODY, dense_m=dense_m)


def cross_traffic(stage: Stage, *, gap_m: Range = (15.0, 30.0), lights: bool = False) -> None:
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
    stage.lights(ego=own, opposite=own, crossing=green_between(0.0, max(red_s - _ALL_RED_S - YELLOW_S, 0.0)))


def lights_turn_red(stage: Stage, *, green_s: float = RED_S, red_s: float = RED_S) -> None:
    """Show green along the ego's road, then red, while the crossing road has its green, then green again."""
    red_at = green_s + YELLOW_S
    own = green_then_red(green_s, red_s)
    between = green_between(red_at + _ALL_RED_S, red_at + max(red_s - _ALL_RED_S - YELLOW_S, 2.0 * _ALL_RED_S))
    stage.lights(ego=own, opposite=own, crossing=between)


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
