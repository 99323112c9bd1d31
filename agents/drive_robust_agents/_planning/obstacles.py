"""Find obstacles that stand or crawl in the ego's lane and will not leave, and the ways around them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from drive_robust_agents._planning import columns as box
from drive_robust_agents._planning.lateral import blend, shift_length_m
from drive_robust_agents._planning.projection import nearest_row
from drive_robust_agents._planning.static_scene import StaticScene
from drive_robust_agents._planning.traffic import Traffic
from pytest_drive_robust.domain.truth import ActorKind
from pytest_drive_robust.jit.arrays import Floats, Floats1, Floats2, Ints, Ints1
from pytest_drive_robust.jit.kernels import entry, inner

__all__ = ["Obstacle", "Pass", "nearest_obstacle", "ways_around"]

_LOOK_M = 80.0
_CRAWL_MPS = 4.5
_CLEAR_M = 0.75
_CLUSTER_M = 15.0
"""Things nearer to each other than this are passed as one obstacle."""
_BESIDE_M = 2.0
"""Things nearer to the middle of the lane than this belong to the obstacle."""
_QUEUE_S = 14.0
"""A car that stands in the middle of the lane longer than this is an obstacle, not part of a queue."""
_HOME_SHARE = 0.8
"""Length of the way back into the lane, as a share of the way out."""
_OFF_CENTRE_M = 0.4
_STARTS_MPS2, _MOVES_MPS, _TURNED = 0.5, 0.1, 0.15
"""An actor with this acceleration is driving off; so is an actor that moves, turned so far across the lane (sine)."""
_BICYCLE, _PEDESTRIAN = int(ActorKind.BICYCLE), int(ActorKind.PEDESTRIAN)

_AT, _HALF, _LEFT, _RIGHT, _SPEED, _BLOCKS = range(6)
"""Columns of the things found: row, half length, left and right side (metres to the right), m/s, 1 if it blocks."""


@dataclass(frozen=True, slots=True)
class Obstacle:
    """An obstacle: its rows, its sides in metres from the middle of the ego's lane, and its speed along the lane."""

    first_row: float
    last_row: float
    left_m: float
    right_m: float
    speed_mps: float

    @property
    def moving(self) -> bool:
        """Whether the obstacle crawls; False when it stands."""
        return self.speed_mps > 0.5


@dataclass(frozen=True, slots=True)
class Pass:
    """A way around an obstacle: a profile to add to the lane's own profile, `hold_m` beside the obstacle.

    The ego leaves its lane at `starts_row`, can still go back until `beside_row`, and is in its lane again at
    `ends_row`. `oncoming`: the way uses a lane of the oncoming traffic.
    """

    shift: Floats
    hold_m: float
    starts_row: float
    beside_row: float
    ends_row: float
    oncoming: bool


def nearest_obstacle(scene: StaticScene, traffic: Traffic, lane: Floats, row: float) -> Obstacle | None:
    """Return the first obstacle ahead along the lane's profile, or None.

    Things near each other, or beside a thing that blocks the lane, count as one obstacle.
    """
    found = _nearest(
        scene.route, scene.cosines, scene.sines, lane, traffic.boxes, traffic.kinds, traffic.stood_s, row,
        scene.half_width_m,
    )  # fmt: skip
    return Obstacle(*found[:5]) if found[5] > 0.0 else None


@inner
def _in_the_way(
    route: Floats, cosines: Floats, sines: Floats, lane: Floats, boxes: Floats, kinds: Ints, stood_s: Floats,
    row: float, half_ego_m: float,
) -> Floats:  # fmt: skip
    """Return the things that block the lane or stand beside it, in the order of `boxes`, with columns as `_AT`."""
    first, last = int(row) - 10, int(row + _LOOK_M) + 25
    count, found = 0, np.empty((len(boxes), 6))
    for i in range(len(boxes)):
        if boxes[i, box.SPEED] >= _CRAWL_MPS or boxes[i, box.ACCEL] >= _STARTS_MPS2 or kinds[i] == _PEDESTRIAN:
            continue
        k = nearest_row(route, first, last, boxes[i, box.X], boxes[i, box.Y])
        dx, dy = boxes[i, box.X] - route[k, 0], boxes[i, box.Y] - route[k, 1]
        at, right = k + dx * cosines[k] + dy * sines[k], dy * cosines[k] - dx * sines[k]
        k = int(min(max(at, 0.0), len(route) - 1.0))
        turn_cos = cosines[k] * boxes[i, box.COS] + sines[k] * boxes[i, box.SIN]
        turn_sin = sines[k] * boxes[i, box.COS] - cosines[k] * boxes[i, box.SIN]
        half_length = 0.5 * (abs(turn_cos) * boxes[i, box.LENGTH] + abs(turn_sin) * boxes[i, box.WIDTH])
        half_width = 0.5 * (abs(turn_cos) * boxes[i, box.WIDTH] + abs(turn_sin) * boxes[i, box.LENGTH])
        right -= lane[k]
        solid, gap = kinds[i] > _PEDESTRIAN, abs(right) - half_width
        turns = boxes[i, box.SPEED] > _MOVES_MPS and abs(turn_sin) > _TURNED and not solid
        if turns and kinds[i] != _BICYCLE:
            continue
        stays = solid or abs(right) > _OFF_CENTRE_M or stood_s[i] > _QUEUE_S or kinds[i] == _BICYCLE
        ahead = at + half_length > row - 3.0 and at - half_length < row + _LOOK_M
        blocks = stays and ahead and gap < half_ego_m + 0.3 and (turn_cos > 0.5 or solid)
        if blocks or (solid and gap < _BESIDE_M):
            found[count, _AT], found[count, _HALF], found[count, _SPEED] = at, half_length, boxes[i, box.SPEED]
            found[count, _LEFT], found[count, _RIGHT] = right - half_width, right + half_width
            found[count, _BLOCKS] = 1.0 if blocks else 0.0
            count += 1
    return found[:count]


@entry
def _nearest(
    route: Floats2, cosines: Floats1, sines: Floats1, lane: Floats1, boxes: Floats2, kinds: Ints1, stood_s: Floats1,
    row: float, half_ego_m: float,
) -> tuple[float, ...]:  # fmt: skip
    """Return the fields of the nearest `Obstacle`, and 1 if there is an obstacle, else 0."""
    found = _in_the_way(route, cosines, sines, lane, boxes, kinds, stood_s, row, half_ego_m)
    start, end, left, right, speed, blocked = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for _ in range(len(found)):  # from the nearest to the farthest
        k = 0
        for other in range(len(found)):
            if found[other, _AT] < found[k, _AT]:
                k = other
        at, half_length = found[k, _AT], found[k, _HALF]
        found[k, _AT] = np.inf
        if blocked == 0.0:
            if found[k, _BLOCKS] > 0.0:
                start, end, left, right, speed = (
                    at - half_length, at + half_length, found[k, _LEFT], found[k, _RIGHT], found[k, _SPEED],
                )  # fmt: skip
                blocked = 1.0
        elif at - half_length < end + _CLUSTER_M:
            start, end = min(start, at - half_length), max(end, at + half_length)
            left, right = min(left, found[k, _LEFT]), max(right, found[k, _RIGHT])
            speed = max(speed, found[k, _SPEED])
    return start, end, left, right, speed, blocked


def ways_around(scene: StaticScene, ahead: Obstacle, row: float, right_m: float, *, speed_mps: float) -> list[Pass]:
    """Return passes on the left, then on the right; the ego is `right_m` to the right of the middle of its lane."""
    half, found = scene.half_width_m, []
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
        beside = abs(hold) > room
        found.append(_pass(scene, ahead, row, right_m, hold, speed_mps, beside=beside, same_way=same_way))
    return found


def _pass(
    scene: StaticScene, ahead: Obstacle, row: float, right_m: float, hold_m: float, speed_mps: float, *, beside: bool,
    same_way: bool,
) -> Pass:  # fmt: skip
    """Return a pass: shift aside (at once to a lane of the same way), hold, come back; follows a crawling obstacle."""
    length = shift_length_m(max(speed_mps, 3.0), hold_m - right_m)
    start = row if beside and same_way else max(row, ahead.first_row - 3.5 - length)
    done = start + length
    until = max(ahead.last_row + 3.4 + (4.0 * ahead.speed_mps if ahead.moving else 0.0), done + 1.0)
    back = max(12.0, _HOME_SHARE * shift_length_m(max(speed_mps, 8.0), hold_m))
    rows = scene.rows
    out, home = blend(rows, start, done), blend(rows, until, until + back)
    shift = (right_m + (hold_m - right_m) * out) * (1.0 - home)
    return Pass(
        shift=shift,
        hold_m=hold_m,
        starts_row=start,
        beside_row=ahead.first_row - scene.half_length_m - 1.0,
        ends_row=until + back,
        oncoming=beside and not same_way,
    )
