"""A town made by hand for the camera tests: two-way road along x, a junction at x = 45, one of every actor."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pytest_drive_robust.domain.truth import (
    ActorKind,
    ActorState,
    EgoState,
    Lane,
    LaneKind,
    LaneMap,
    LightState,
    StopLine,
    WorldState,
)

SIZES = {
    ActorKind.CAR: (4.6, 1.9, 1.5),
    ActorKind.VAN: (5.4, 2.0, 2.3),
    ActorKind.TRUCK: (8.5, 2.5, 3.4),
    ActorKind.EMERGENCY: (5.6, 2.1, 2.5),
    ActorKind.BICYCLE: (1.8, 0.6, 1.7),
    ActorKind.PEDESTRIAN: (0.5, 0.6, 1.75),
    ActorKind.CONE: (0.4, 0.4, 0.75),
    ActorKind.BARRIER: (1.8, 0.4, 1.0),
    ActorKind.CONTAINER: (6.0, 2.4, 2.6),
    ActorKind.WARNING_SIGN: (0.5, 1.2, 1.4),
    ActorKind.BUILDING: (12.0, 10.0, 9.0),
    ActorKind.DOOR: (0.9, 0.9, 1.1),
    ActorKind.DIRT: (4.0, 3.0, 0.02),
}


def actor(
    kind: ActorKind,
    x: float,
    y: float,
    *,
    yaw: float = 0.0,
    number: int = 1,
    speed: float = 0.0,
    state: ActorState = ActorState.NONE,
) -> list[float]:
    return [float(number), float(kind), x, y, yaw, speed, *SIZES[kind], float(state)]


def frame(
    *actors: list[float],
    x: float = 0.0,
    y: float = 1.75,
    yaw: float = 0.0,
    tick: int = 0,
    lights: tuple[LightState, ...] = (LightState.RED, LightState.GREEN, LightState.STOP_SIGN),
) -> WorldState:
    ego = EgoState(x, y, yaw, 0.0, 0.0, 0.0, 0.0, 4.6, 1.9)
    rows = np.array(actors, np.float64).reshape(len(actors), 10)
    return WorldState(tick, ego, rows, np.array(lights, np.int64))


def _points(start: tuple[float, float], end: tuple[float, float]) -> NDArray[np.float64]:
    length = math.dist(start, end)
    x, y = (np.linspace(a, b, int(length) + 1) for a, b in zip(start, end, strict=True))
    return np.column_stack((x, y, np.full(len(x), math.atan2(end[1] - start[1], end[0] - start[0]))))


def lane(
    index: int,
    start: tuple[float, float],
    end: tuple[float, float],
    *,
    kind: LaneKind = LaneKind.DRIVING,
    width: float = 3.5,
    left: int = -1,
    right: int = -1,
    left_same_way: bool = False,
    left_line: str = "none",
    right_line: str = "none",
    junction: bool = False,
) -> Lane:
    return Lane(
        index,
        kind,
        _points(start, end),
        width,
        13.9,
        junction,
        left,
        right,
        left_same_way,
        True,
        left_line,
        right_line,
        (),
    )


def town(*, buildings: bool = True) -> LaneMap:
    """Make an east lane at y = 1.75 with parking at its right, a west lane at y = -1.75, a road along y at x = 45."""
    lanes = (
        lane(0, (-60, 1.75), (38, 1.75), left=1, right=2, left_line="striped", right_line="striped"),
        lane(1, (38, -1.75), (-60, -1.75), left=0, left_line="striped", right_line="solid"),
        lane(
            2, (-60, 4.75), (30, 4.75), kind=LaneKind.PARKING, width=2.5, left=0, left_same_way=True, right_line="solid"
        ),
        lane(3, (-60, 7.25), (36, 7.25), kind=LaneKind.SIDEWALK, width=2.5),
        lane(4, (-60, -4.75), (36, -4.75), kind=LaneKind.SIDEWALK, width=2.5),
        lane(5, (38, 1.75), (52, 1.75), junction=True),
        lane(6, (52, -1.75), (38, -1.75), junction=True),
        lane(7, (52, 1.75), (160, 1.75), left=8, left_line="solid", right_line="solid"),
        lane(8, (160, -1.75), (52, -1.75), left=7, left_line="solid", right_line="solid"),
        lane(9, (46.75, 60), (46.75, -60), right_line="none"),
        lane(10, (43.25, -60), (43.25, 60), right_line="none"),
    )
    stop_lines = (
        StopLine(0, 0, 37.0, 1.75, 0.0, 3.5, True, 39.0, 4.6),
        StopLine(1, 8, 53.0, -1.75, math.pi, 3.5, True, 51.0, -4.6),
        StopLine(2, 10, 43.25, -6.0, math.pi / 2, 3.5, False, 40.5, -5.5),
    )
    crosswalks = np.array([[(32.5, -3.5), (35.5, -3.5), (35.5, 6.0), (32.5, 6.0)]], np.float64)
    houses = np.array(
        [
            (10.0, 16.0, 0.0, 24.0, 10.0, 9.0),
            (-18.0, 16.0, 0.0, 20.0, 10.0, 14.0),
            (8.0, -14.0, 0.0, 22.0, 10.0, 12.0),
            (62.0, 16.0, 0.0, 16.0, 12.0, 8.0),
            (64.0, -16.0, 0.3, 14.0, 12.0, 16.0),
        ]
    )
    return LaneMap("hand-made", lanes, stop_lines, crosswalks, houses if buildings else np.zeros((0, 6)))


def busy_frame(tick: int = 0) -> WorldState:
    """Return one of every actor ahead of the ego."""
    kind, state = ActorKind, ActorState
    return frame(
        actor(kind.CAR, 14.0, 1.75, number=1, speed=4.0, state=state.BRAKING | state.INDICATOR_LEFT),
        actor(kind.CAR, 11.0, 4.75, number=2),
        actor(kind.VAN, 18.0, 4.75, number=3, state=state.INDICATOR_LEFT),
        actor(kind.TRUCK, 28.0, -1.75, yaw=math.pi, number=4, speed=8.0),
        actor(kind.EMERGENCY, 15.0, -1.75, yaw=math.pi, number=5, speed=8.0, state=state.SIREN),
        actor(kind.BICYCLE, 8.0, 3.9, number=6, speed=4.0),
        actor(kind.PEDESTRIAN, 7.0, -4.6, number=7, speed=1.2),
        actor(kind.PEDESTRIAN, 34.0, 0.0, yaw=math.pi / 2, number=8, speed=1.2),
        actor(kind.CONE, 6.0, 0.2, number=9),
        actor(kind.CONE, 8.0, 0.2, number=10),
        actor(kind.BARRIER, 9.5, -3.6, yaw=math.pi / 2, number=11),
        actor(kind.CONTAINER, 56.0, 5.5, number=12),
        actor(kind.WARNING_SIGN, 9.0, 6.6, number=13),
        actor(kind.CAR, 45.0, 1.75, yaw=0.4, number=14),
        tick=tick,
    )


def without(shown: WorldState, number: int) -> WorldState:
    """Return the frame without the actor of that id."""
    return replace(shown, actors=shown.actors[shown.actors[:, WorldState.ID] != number])


def around() -> NDArray[np.float64]:
    """Return points of the route: straight through the junction."""
    return np.column_stack((np.arange(0.0, 110.0), np.full(110, 1.75)))
