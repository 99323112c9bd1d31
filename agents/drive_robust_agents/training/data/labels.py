"""Labels of one moment: the expert's future way, its controls and its surroundings.

All points are in the ego frame of the moment: x forward, y right, metres; yaw clockwise. Perception (boxes, map
vectors) is in `perception`, the facts for sentences in `facts`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drive_robust_agents._planning.intent import Intent
from drive_robust_agents._planning.projection import nearest_ahead, project
from drive_robust_agents._vehicle.mkz import TICK_S
from drive_robust_agents._wrappers.route_planner import Target
from pytest_drive_robust import Control
from pytest_drive_robust.domain.truth import ActorKind, EgoState, GroundTruth, WorldState
from pytest_drive_robust.jit.arrays import Floats

__all__ = [
    "BRANCH_TICKS", "FUTURE_TICKS", "LOOK_M", "ExpertMoment", "Row", "body_ahead", "gap_ahead", "motion_labels",
    "path_ahead", "to_ego", "way_labels",
]  # fmt: skip

Row = Mapping[str, NDArray[Any]]
"""One sample: an array for each name."""

FUTURE_TICKS = tuple(range(5, 61, 5))
"""The future is labelled at these ticks from now: 0.25, 0.5 ... 3 s."""
BRANCH_TICKS = FUTURE_TICKS[-1]
CONTROL_TICKS = (0, 10, 20, 30, 40)
PATH_POINTS = 24
LOOK_M = 100.0
"""Range ahead; farther things are left out."""
_BODY = [WorldState.X, WorldState.Y, WorldState.YAW, WorldState.SPEED, WorldState.LENGTH, WorldState.WIDTH]


@dataclass(frozen=True, slots=True)
class ExpertMoment:
    """A moment: the world, the expert's intent, and the targets of the planners (4 m, 7.5 m)."""

    truth: GroundTruth
    intent: Intent
    targets: tuple[Target, Target]
    night: bool

    @property
    def ego(self) -> EgoState:
        """The ego of this moment."""
        return self.truth.state.ego


def to_ego(ego: EgoState, points: Floats) -> Floats:
    """Return (n, 2) points of the route's frame as seen from the ego, metres (forward, right)."""
    c, s = math.cos(ego.yaw_rad), math.sin(ego.yaw_rad)
    away = points[..., :2] - (ego.x_m, ego.y_m)
    return np.stack([away[..., 0] * c + away[..., 1] * s, away[..., 1] * c - away[..., 0] * s], axis=-1)


def way_labels(here: ExpertMoment) -> dict[str, NDArray[Any]]:
    """Return the labels that need no future: `speed`, `imu`, `pose`, `command`, `target`, `path`, `gap`."""
    ego = here.ego
    targets = [target.seen_from(ego.x_m, ego.y_m, ego.yaw_rad) for target in here.targets]
    gap_m, gap_mps = gap_ahead(here)
    return {
        "speed": np.float32(ego.speed_mps),
        "imu": np.array([ego.forward_mps2, ego.right_mps2, ego.yaw_rate_radps], dtype=np.float32),
        "pose": np.array([ego.x_m, ego.y_m, ego.yaw_rad]),
        "command": np.array([int(target.command) for target in here.targets], dtype=np.int8),
        "target": np.array(targets, dtype=np.float32),
        "path": path_ahead(ego, here.intent.line, here.intent.row).astype(np.float32),
        "gap": np.array([gap_m, gap_mps], dtype=np.float32),
    }


def motion_labels(states: Sequence[WorldState], controls: Sequence[Control]) -> dict[str, NDArray[Any]]:
    """Return `future`, `future_ok` and `controls` of a drive that begins with the moment.

    `states` holds one state of the world per tick; `controls` holds the expert's control for each state, maybe without
    the last. A drive shorter than 3 s is extrapolated at its last speed and curvature, with `future_ok` False.
    """
    ego = states[0].ego
    poses, ok = np.empty((len(FUTURE_TICKS), 4)), np.zeros(len(FUTURE_TICKS), dtype=bool)
    for k, tick in enumerate(FUTURE_TICKS):
        ok[k] = tick < len(states)
        later = states[tick].ego if ok[k] else _goes_on(states[-1].ego, (tick - len(states) + 1) * TICK_S)
        poses[k] = later.x_m, later.y_m, math.remainder(later.yaw_rad - ego.yaw_rad, math.tau), later.speed_mps
    poses[:, :2] = to_ego(ego, poses)
    told = [controls[min(tick, len(controls) - 1)] for tick in CONTROL_TICKS]
    return {
        "future": poses.astype(np.float32),
        "future_ok": ok,
        "controls": np.array([(one.throttle, one.steer, one.brake) for one in told], dtype=np.float32),
    }


def path_ahead(ego: EgoState, line: Floats, row: float) -> Floats:
    """Return (24, 2): the points 1, 2 ... 24 m ahead along the line (n, 3 or more), counted from beside the ego."""
    at, _ = project(line, int(row) - 6, int(row) + 14, ego.x_m, ego.y_m)
    k = int(np.clip(at, 0, len(line) - 2))
    x, y, yaw = line[-1, :3]
    beyond = np.array([[x + 100.0 * math.cos(yaw), y + 100.0 * math.sin(yaw)]])
    ahead = np.concatenate([line[k:, :2], beyond])
    s = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(ahead, axis=0).T))]) - (at - k)
    wanted = np.arange(1.0, PATH_POINTS + 1.0)
    points = np.column_stack([np.interp(wanted, s, ahead[:, 0]), np.interp(wanted, s, ahead[:, 1])])
    return to_ego(ego, points)


def gap_ahead(here: ExpertMoment) -> tuple[float, float]:
    """Return (metres from the front bumper, speed along the way) of the nearest thing on the expert's way.

    Things are bodies in the expert's corridor and the place where it has to wait. Without a thing within 100 m, return
    100 and the ego's own speed.
    """
    intent, ego = here.intent, here.ego
    solid = here.truth.state.actors[here.truth.state.actors[:, WorldState.KIND] != ActorKind.DIRT]
    found_m, found_mps = body_ahead(here, solid)
    wait_m = intent.stop_row - intent.row - 0.5 * ego.length_m
    if wait_m < found_m:
        found_m, found_mps = max(wait_m, 0.0), 0.0
    return (found_m, found_mps) if found_m < LOOK_M else (LOOK_M, ego.speed_mps)


def body_ahead(here: ExpertMoment, actors: Floats) -> tuple[float, float]:
    """Return (metres bumper to bumper, speed along the way) of the first of these actors in the corridor."""
    ego, intent = here.ego, here.intent
    bodies = np.ascontiguousarray(actors[:, _BODY])
    found = nearest_ahead(intent.line, int(intent.row), (ego.x_m, ego.y_m, ego.length_m, ego.width_m), bodies)
    return max(float(found[0]), 0.0), float(found[1])


def _goes_on(ego: EgoState, seconds: float) -> EgoState:
    """Return the ego `seconds` later, with constant speed and curvature."""
    turn = ego.yaw_rate_radps * seconds
    half = 0.5 * turn
    chord = ego.speed_mps * seconds * (math.sin(half) / half if abs(half) > 1e-9 else 1.0)
    x, y = ego.x_m + chord * math.cos(ego.yaw_rad + half), ego.y_m + chord * math.sin(ego.yaw_rad + half)
    return replace(ego, x_m=x, y_m=y, yaw_rad=ego.yaw_rad + turn, forward_mps2=0.0)
