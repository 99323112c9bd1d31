"""Parts that scenario types share: numbers of the route file, traffic beside the route, flows, lights."""

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
"""Seconds for which lights stay red (or green) after the scenario started."""
_ALL_RED_S = 1.0
_MEET_M = 1.0
_SLOWEST_MPS, _ACROSS_S = 4.0, 8.0
"""Approach speed and time to cross of the slowest ego that meets no lengthened gap of a flow."""


def ahead(stage: Stage, default_m: float, *, at_least_m: float = 20.0) -> float:
    """Return metres from the trigger to the event: the element `distance`, or `at_least_m` if that is farther."""
    return max(stage.spec.number("distance", default_m), at_least_m)


def speed(stage: Stage, element: str, default_kmh: float, *, at_least_kmh: float = 3.0) -> float:
    """Return the speed of an element, which is in km/h, in m/s; limited to `at_least_kmh`..150 km/h."""
    return min(max(stage.spec.number(element, default_kmh), at_least_kmh), 150.0) * KMH


def right_hand(stage: Stage) -> float:
    """Return -1 when the element `direction` is `left`, else 1: the side where things stand or come from."""
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
    """Add traffic to the left lane (the right lane for obstacles to the left), at the speed of the element `speed`.

    Bench2Drive slows that lane down five seconds after the ego came near; ours has constant speed and some long gaps
    among the short gaps (`scenario_runner/srunner/scenarios/route_obstacles.py`).
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
    """Add oncoming traffic that only shares the road; a one-way road gets no such traffic."""
    with suppress(RouteError):
        stage.flow(stage.oncoming(), speed_mps=0.8 * stage.speed_limit_mps, gap_m=gap_m, background=True)


def rolling_start(stage: Stage) -> float:
    """Start the ego at 70 % of the limit on fast roads, elsewhere at rest; return this speed in m/s."""
    stage.start_mps = 0.7 * stage.speed_limit_mps if stage.speed_limit_mps > _FAST_MPS else 0.0
    return stage.start_mps


def route_flow(stage: Stage, path: int, *, meets_ahead_m: float, kinds: tuple[ActorKind, ...] = CARS) -> None:
    """Add the flow of the route file: `flow_speed`, gaps from `source_dist_interval`, from edge to edge of the town.

    The type's ranges replace elements that the file leaves out (the mean, for the speed). The drivers keep their speed
    and give way to nobody until one driver has been hit; then all drivers brake for bodies ahead. Bench2Drive's drivers
    give way to nobody, too (`scenario_runner/srunner/scenariomanager/scenarioatomics/atomic_behaviors.py`,
    `ActorFlow`). An ego that reaches `meets_ahead_m` without waiting, even slowly, meets no lengthened gap.
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
    """Add background traffic straight on from the junction's other arms.

    Its speed is 80 % of the lower speed limit, of the ego's lane and of the ego's way through the junction.
    Bench2Drive's sources at a junction send the next car once the last car is 15 m away
    (`scenario_runner/srunner/scenarios/background_activity.py`).

    Without `lights` crossing and oncoming traffic would block each other, so oncoming traffic is added only where no
    traffic crosses.
    """
    inside = stage.lane_at(stage.junction_ahead_m() + 1.0)
    speed = 0.8 * min(stage.speed_limit_mps, inside.speed_limit_mps)
    crossed = False
    for bearing in ("left", "right", "opposite"):
        if bearing == "opposite" and crossed and not lights:
            break
        with suppress(RouteError):  # a junction of three arms lacks one bearing
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
    """Return (metres ahead on the ego's path, metres along `path`) where both first meet in the junction, or None.

    The paths meet where their distance is below `within_m`; with an infinite `within_m`, at their least distance.
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
    """End the scenario `metres` behind the ego's first junction."""
    stage.end_m = stage.trigger_m + stage.exit_ahead_m() + metres
