"""What several scenario types share: bounded numbers of the route file, the width of the road, traffic beside it."""

from __future__ import annotations

import contextlib

from pytest_drive_robust.domain.truth import LaneKind
from pytest_drive_robust.errors import RouteError
from pytest_drive_robust.simulators.embedded.stage import Stage

__all__ = [
    "KMH",
    "ahead",
    "oncoming_gaps",
    "right_hand",
    "road_edge_m",
    "rolling_start",
    "scenery",
    "side_traffic",
    "speed",
]

KMH = 1.0 / 3.6
"""A kilometre per hour in metres per second."""

_FAST_MPS = 15.0


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
    lanes = stage.dense.lane_map.lanes
    lane = stage.lane_at(ahead_m)
    away = lane.width_m / 2.0
    for _ in lanes:
        index, same_way = (lane.left, lane.left_same_way) if side == "left" else (lane.right, lane.right_same_way)
        if index < 0 or lanes[index].kind is LaneKind.SIDEWALK:
            break
        lane = lanes[index]
        away += lane.width_m
        if not same_way:  # seen from the other way, the far kerb is to the right
            side = "right" if side == "left" else "left"
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


def oncoming_gaps(stage: Stage, default_m: tuple[float, float]) -> None:
    """Let cars come the other way, with gaps from the element `frequency` (`from`, `to` or `value`)."""
    given = stage.spec.parameters.get("frequency", {})
    ends = [given.get(name, given.get("value", usual)) for name, usual in zip(("from", "to"), default_m, strict=True)]
    stage.flow(stage.oncoming(), speed_mps=0.8 * stage.speed_limit_mps, gap_m=(min(ends), max(ends)), background=True)


def scenery(stage: Stage, gap_m: tuple[float, float] = (45.0, 90.0)) -> None:
    """Add traffic the other way that only shares the road; a one-way road has none."""
    with contextlib.suppress(RouteError):
        stage.flow(stage.oncoming(), speed_mps=0.8 * stage.speed_limit_mps, gap_m=gap_m, background=True)


def rolling_start(stage: Stage) -> float:
    """Start the ego at 70 % of the limit on fast roads, elsewhere at rest; return its speed in metres per second."""
    stage.start_mps = 0.7 * stage.speed_limit_mps if stage.speed_limit_mps > _FAST_MPS else 0.0
    return stage.start_mps
