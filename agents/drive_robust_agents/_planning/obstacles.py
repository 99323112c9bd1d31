"""What stands or crawls in the ego's lane and will not go away, and the ways around it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from drive_robust_agents._planning.control import Floats
from drive_robust_agents._planning.lateral import blend, shift_length_m
from drive_robust_agents._planning.projection import project_all
from drive_robust_agents._planning.static_scene import StaticScene
from drive_robust_agents._planning.traffic import Traffic
from pytest_drive_robust.domain.truth import ActorKind

__all__ = ["Obstacle", "Pass", "nearest_obstacle", "ways_around"]

_LOOK_M = 80.0
_CRAWL_MPS = 4.5
_CLEAR_M = 0.75
_CLUSTER_M = 15.0
"""Things nearer to each other than this are passed in one go."""
_BESIDE_M = 2.0
"""Things that stand nearer to the middle of the lane than this belong to what blocks it."""
_QUEUE_S = 14.0
"""A car that stands in the middle of the lane longer than this is no queue."""
_HOME_SHARE = 0.8
"""The way back into the lane is this much sharper than the way out of it."""
_OFF_CENTRE_M = 0.4
_STARTS_MPS2 = 0.5
"""Who accelerates like this is on the way."""


@dataclass(frozen=True, slots=True)
class Obstacle:
    """Rows and sideways metres (from the middle of the ego's lane) that it takes up; its speed along the lane."""

    first_row: float
    last_row: float
    left_m: float
    right_m: float
    speed_mps: float

    @property
    def moving(self) -> bool:
        """Whether it crawls, rather than stands."""
        return self.speed_mps > 0.5

    def joined(self, other: Obstacle) -> Obstacle:
        """Return both as one obstacle."""
        return Obstacle(
            min(self.first_row, other.first_row),
            max(self.last_row, other.last_row),
            min(self.left_m, other.left_m),
            max(self.right_m, other.right_m),
            max(self.speed_mps, other.speed_mps),
        )


@dataclass(frozen=True, slots=True)
class Pass:
    """A way around: sideways metres to be added to the lane's own profile, `hold_m` beside the obstacle.

    It leaves the lane at `starts_row`; until the ego reaches `beside_row` it can still go back; at `ends_row` it is in
    its lane again.
    """

    shift: Floats
    hold_m: float
    starts_row: float
    beside_row: float
    ends_row: float


def nearest_obstacle(scene: StaticScene, traffic: Traffic, lane: Floats, row: float) -> Obstacle | None:
    """Return the first thing ahead that has to be passed on the way along the lane's profile, or None."""
    boxes = traffic.boxes
    slow = (boxes[:, 3] < _CRAWL_MPS) & (boxes[:, 6] < _STARTS_MPS2) & (traffic.kinds != ActorKind.PEDESTRIAN)
    if not slow.any():
        return None
    at = project_all(scene.route, int(row) - 10, int(row + _LOOK_M) + 25, boxes[slow])
    rows = np.clip(at[:, 0], 0, scene.count - 1).astype(int)
    turn = scene.route[rows, 2] - boxes[slow, 2]
    co, si = np.abs(np.cos(turn)), np.abs(np.sin(turn))
    half_length = 0.5 * (co * boxes[slow, 4] + si * boxes[slow, 5])
    half_width = 0.5 * (co * boxes[slow, 5] + si * boxes[slow, 4])
    right = at[:, 1] - lane[rows]
    in_lane = np.abs(right) - half_width < scene.size[1] / 2.0 + 0.3
    ahead = (at[:, 0] + half_length > row - 3.0) & (at[:, 0] - half_length < row + _LOOK_M)
    stays = (traffic.kinds[slow] > ActorKind.PEDESTRIAN) | (np.abs(right) > _OFF_CENTRE_M)
    stays |= (traffic.stood_s[slow] > _QUEUE_S) | (traffic.kinds[slow] == ActorKind.BICYCLE)
    going = (np.cos(turn) > 0.5) | (traffic.kinds[slow] > ActorKind.PEDESTRIAN)
    solid = traffic.kinds[slow] > ActorKind.PEDESTRIAN
    near = np.abs(right) - half_width < _BESIDE_M
    found: Obstacle | None = None
    for k in np.argsort(at[:, 0], kind="stable"):
        one = Obstacle(
            float(at[k, 0] - half_length[k]), float(at[k, 0] + half_length[k]), float(right[k] - half_width[k]),
            float(right[k] + half_width[k]), float(boxes[slow, 3][k]),
        )  # fmt: skip
        blocks = in_lane[k] and ahead[k] and stays[k] and going[k]
        if found is None:
            found = one if blocks else None
        elif (blocks or (solid[k] and near[k])) and one.first_row < found.last_row + _CLUSTER_M:
            found = found.joined(one)  # what stands beside it is passed with it
    return found


def ways_around(scene: StaticScene, ahead: Obstacle, row: float, right_m: float, *, speed_mps: float) -> list[Pass]:
    """Return passes on the left, then on the right; the ego is `right_m` beside the middle of its lane."""
    half, found = scene.size[1] / 2.0, []
    for side, sign, edge in (("left", -1.0, ahead.left_m), ("right", 1.0, ahead.right_m)):
        lane, same_way = scene.neighbour(max(ahead.first_row, row), side)
        hold = edge + sign * (_CLEAR_M + half)
        if hold * sign < 0.0:
            hold = 0.0
        room = scene.lane_at(row).width_m / 2.0 - half - 0.1
        if abs(hold) > room:
            if lane is None or (side == "right" and not same_way):
                continue
            if same_way:
                hold = sign * max(abs(hold), 0.5 * (scene.lane_at(row).width_m + lane.width_m))
        found.append(_pass(scene, ahead, row, right_m, hold, speed_mps, early=same_way and abs(hold) > room))
    return found


def _pass(
    scene: StaticScene, ahead: Obstacle, row: float, right_m: float, hold_m: float, speed_mps: float, *, early: bool
) -> Pass:
    """Shift until beside it (`early`: at once), hold, come back; a crawling thing is followed with the hold."""
    length = shift_length_m(max(speed_mps, 3.0), hold_m - right_m)
    start = row if early else max(row, ahead.first_row - 3.5 - length)
    done = start + length
    until = max(ahead.last_row + 3.4 + (4.0 * ahead.speed_mps if ahead.moving else 0.0), done + 1.0)
    back = max(12.0, _HOME_SHARE * shift_length_m(max(speed_mps, 8.0), hold_m))
    rows = scene.rows
    out, home = blend(rows, start, done), blend(rows, until, until + back)
    shift = (right_m + (hold_m - right_m) * out) * (1.0 - home)
    return Pass(shift, hold_m, start, ahead.first_row - scene.size[0] / 2.0 - 1.0, until + back)
