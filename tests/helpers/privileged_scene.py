"""A straight street as ground truth, for tests of agents that see it: two lanes along x, one of them oncoming."""

from __future__ import annotations

import math

import numpy as np

from drive_robust_agents._planning.static_scene import StaticScene
from drive_robust_agents._planning.traffic import Traffic
from pytest_drive_robust import Compass, Gps, Imu, Observation, Speed
from pytest_drive_robust.domain.truth import (
    ActorKind,
    EgoState,
    GroundTruth,
    Lane,
    LaneKind,
    LaneMap,
    LightState,
    StopLine,
    WorldState,
)

LANE_M, LENGTH_M, LIMIT_MPS = 3.5, 200, 12.0
SIZES = {ActorKind.CAR: (4.6, 1.9), ActorKind.BICYCLE: (1.8, 0.6), ActorKind.PEDESTRIAN: (0.5, 0.6)}


def actor(
    x_m: float, right_m: float, *, speed_mps: float = 0.0, yaw_rad: float = 0.0, kind: ActorKind = ActorKind.CAR
) -> list[float]:
    """Return a row of `WorldState.actors`; ids are given by `street`."""
    length, width = SIZES[kind]
    return [0.0, float(kind), x_m, right_m, yaw_rad, speed_mps, length, width, 1.5, 0.0]


def street(
    *actors: list[float], x_m: float = 20.0, right_m: float = 0.0, speed_mps: float = 0.0, same_way: bool = False,
    light: tuple[float, LightState] | None = None,
) -> GroundTruth:  # fmt: skip
    """Put the ego at x on the right lane of a street along x; the left lane leads the other way or the same way.

    `light` is where a light or a stop sign stands on the ego's lane, and its state.
    """
    s = np.arange(LENGTH_M + 1.0)
    mine = np.column_stack([s, np.zeros(len(s)), np.zeros(len(s))])
    other = np.column_stack([s, np.full(len(s), -LANE_M), np.zeros(len(s))])
    if not same_way:
        other = np.column_stack([s[::-1], np.full(len(s), -LANE_M), np.full(len(s), math.pi)])
    style = {"width_m": LANE_M, "speed_limit_mps": LIMIT_MPS, "junction": False, "successors": ()}
    lines = {"left_line": "striped", "right_line": "solid"}
    lanes = (
        Lane(
            0, LaneKind.DRIVING, mine, left=1, right=-1, left_same_way=same_way, right_same_way=False, **style, **lines
        ),
        Lane(
            1, LaneKind.DRIVING, other, left=-1 if same_way else 0, right=0 if same_way else -1, left_same_way=False,
            right_same_way=same_way, **style, **lines,
        ),
    )  # fmt: skip
    rows = np.array(actors, dtype=float).reshape(-1, 10)
    rows[:, WorldState.ID] = np.arange(len(rows))
    stops, lights = (), np.zeros(0, dtype=np.int64)
    if light is not None:
        at, state = light
        stops = (StopLine(0, 0, at, 0.0, 0.0, LANE_M, state is not LightState.STOP_SIGN, at, 3.0),)
        lights = np.array([int(state)])
    ego = EgoState(x_m, right_m, 0.0, speed_mps, 0.0, 0.0, 0.0, 4.892, 1.837)
    route = np.column_stack([mine, np.full(len(s), LIMIT_MPS)])
    lane_map = LaneMap("a straight street", lanes, stops, np.zeros((0, 4, 2)), np.zeros((0, 6)))
    return GroundTruth(WorldState(0, ego, rows, lights), lane_map, route, int(x_m))


def observation(truth: GroundTruth | None, tick: int = 0) -> Observation:
    """Return what a privileged agent is given; its sensors say nothing of interest."""
    return Observation(
        tick=tick,
        gps=Gps(0.0, 0.0, tick),
        compass=Compass(0.0, tick),
        imu=Imu(0.0, 0.0, 0.0, tick),
        speed=Speed(0.0, tick),
        cameras={},
        truth=truth,
    )


def seen(truth: GroundTruth) -> tuple[StaticScene, Traffic]:
    """Return the scene and the traffic as the expert sees them in its first tick."""
    scene, traffic = StaticScene(truth), Traffic()
    traffic.update(truth.state, scene.graph)
    return scene, traffic
