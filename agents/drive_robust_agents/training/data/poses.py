"""Draw poses beside the expert's way, from which a learner has to know the way back."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pytest_drive_robust.domain.truth import ActorKind, EgoState, LaneKind, LaneMap, WorldState
from pytest_drive_robust.jit.arrays import Floats

__all__ = ["FreeSpace", "Pose", "draw_pose"]

LATERAL_M, YAW_RAD, SPEED_MPS = (0.3, 1.5), math.radians(15.0), 3.0
_ASIDE_MPS = 2.5
"""Greatest sideways speed of a drawn pose, which limits its turn at speed."""
SPEED_SHARE, STOP_SHARE, STOP_FROM_MPS = 1.0 / 3.0, 0.1, 2.0
_ELBOW_M, _KERB_M = 0.25, 0.3
_NEAR_M = 12.0


@dataclass(frozen=True, slots=True)
class Pose:
    """A pose for the ego: metres and radians in the route's frame, m/s; `start`: at rest on a free way."""

    x_m: float
    y_m: float
    yaw_rad: float
    speed_mps: float
    start: bool = False

    @classmethod
    def of(cls, ego: EgoState) -> Pose:
        """Return the pose of the ego."""
        return cls(ego.x_m, ego.y_m, ego.yaw_rad, ego.speed_mps)


def draw_pose(ego: EgoState, rng: np.random.Generator) -> Pose:
    """Draw a pose 0.3 to 1.5 m aside and up to 15 degrees turned; a third up to 3 m/s off, a tenth at rest."""
    most = min(YAW_RAD, _ASIDE_MPS / max(ego.speed_mps, 1.0))
    right = float(rng.uniform(*LATERAL_M)) * (1.0 if rng.random() < 0.5 else -1.0)
    yaw = ego.yaw_rad + float(rng.uniform(-most, most))
    share, faster = float(rng.random()), float(rng.uniform(-SPEED_MPS, SPEED_MPS))
    start = share < STOP_SHARE and ego.speed_mps > STOP_FROM_MPS
    speed = ego.speed_mps
    if start:
        speed = 0.0
    elif STOP_SHARE <= share < STOP_SHARE + SPEED_SHARE:
        speed = max(0.0, speed + faster)
    x, y = ego.x_m - right * math.sin(ego.yaw_rad), ego.y_m + right * math.cos(ego.yaw_rad)
    return Pose(x, y, yaw, speed, start)


class FreeSpace:
    """Tests poses of the ego for free space: on the roads of a map, between the actors."""

    def __init__(self, lane_map: LaneMap) -> None:
        lanes = [lane for lane in lane_map.lanes if lane.kind is not LaneKind.SIDEWALK]
        self._points = np.concatenate([lane.centre[:, :2] for lane in lanes])
        self._reach = np.concatenate([np.full(len(lane.centre), lane.width_m / 2.0 + _KERB_M) for lane in lanes])
        self._buildings = lane_map.buildings[:, :5]

    def is_free(self, state: WorldState, pose: Pose) -> bool:
        """Return whether all corners of the ego are on the road, a hand's breadth away from all that is solid."""
        length, width = state.ego.length_m, state.ego.width_m
        if not self._on_road(_corners(pose.x_m, pose.y_m, pose.yaw_rad, length, width)):
            return False
        solid = state.actors[state.actors[:, WorldState.KIND] != ActorKind.DIRT]
        columns = [WorldState.X, WorldState.Y, WorldState.YAW, WorldState.LENGTH, WorldState.WIDTH]
        boxes = np.concatenate([solid[:, columns], self._buildings])
        near = np.abs(boxes[:, :2] - (pose.x_m, pose.y_m)).max(axis=1) < _NEAR_M + boxes[:, 3:].max(axis=1)
        mine = np.array([pose.x_m, pose.y_m, pose.yaw_rad, length + 2.0 * _ELBOW_M, width + 2.0 * _ELBOW_M])
        return not any(_overlap(mine, box) for box in boxes[near])

    def _on_road(self, corners: Floats) -> bool:
        near = np.abs(self._points - corners.mean(axis=0)).max(axis=1) < _NEAR_M
        away = np.linalg.norm(corners[:, None] - self._points[near], axis=2)
        return bool((away < np.hypot(self._reach[near], 0.5)).any(axis=1).all())


def _corners(x: float, y: float, yaw: float, length: float, width: float) -> Floats:
    c, s = math.cos(yaw), math.sin(yaw)
    local = 0.5 * np.array([[length, width], [length, -width], [-length, -width], [-length, width]])
    turned: Floats = local @ np.array([[c, s], [-s, c]]) + (x, y)
    return turned


def _overlap(a: Floats, b: Floats) -> bool:
    """Return whether two boxes (x, y, yaw, length, width) overlap, by separating axes."""
    corners = _corners(*map(float, a)), _corners(*map(float, b))
    for yaw in (a[2], b[2]):
        for angle in (yaw, yaw + math.pi / 2.0):
            axis = np.array([math.cos(angle), math.sin(angle)])
            one, two = corners[0] @ axis, corners[1] @ axis
            if one.max() <= two.min() or two.max() <= one.min():
                return False
    return True
