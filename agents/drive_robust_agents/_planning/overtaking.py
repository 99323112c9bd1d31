"""Pass obstacles in the ego's lane: wait for a free way around, and give it up while the ego can still stop."""

from __future__ import annotations

import math

from drive_robust_agents._planning.obstacles import Obstacle, Pass, nearest_obstacle, ways_around
from drive_robust_agents._planning.situation import Situation
from drive_robust_agents._planning.speed import is_free
from pytest_drive_robust.jit.arrays import Floats

__all__ = ["Overtaking"]

_WAIT_BEFORE_M = 7.0
"""Distance at which the front bumper stops before an obstacle, which leaves room for the way around."""
_HALT_MPS2 = 4.0
"""Deceleration to stop when the ego is nearer than `_WAIT_BEFORE_M` already."""
_EARLY_M, _LOOK_M = 10.0, 90.0
"""A pass is chosen so far before it starts, and must be free so far ahead."""
_DOUBTS = 6
"""Ticks after which a pass that is not free is given up."""
_NEAR_M, _NEAR_S, _BORROW_AFTER_S = (10.0, 30.0), 3.0, 5.1
"""Distances and time at which the ego counts as near an obstacle (within 3 s at its speed, limited to 10..30 m), and
the seconds after which the oncoming lane is free then (all scenarios with `TwoWays` in Bench2Drive)."""


class Overtaking:
    """The pass under way, `current`, and how long the ego has been near the obstacle before it.

    `lane` is the profile of the ego's lane in all methods.
    """

    def __init__(self) -> None:
        self.current: Pass | None = None
        self._near_s = 0.0
        self._doubts = 0

    def end(self, lane: Floats, now: Situation) -> None:
        """End the pass when it is driven, or when it is no longer free and the ego can still stop."""
        if self.current is not None and (now.row > self.current.ends_row or self._gives_up(self.current, lane, now)):
            self.current = None

    def begin(self, lane: Floats, now: Situation) -> Obstacle | None:
        """Begin to pass an obstacle in the lane; return the obstacle while no way around it is free, else None."""
        ahead = nearest_obstacle(now.scene, now.traffic, lane, now.row)
        if ahead is None:
            self._near_s = 0.0
            return None
        near_m = min(max(_NEAR_S * now.speed_mps, _NEAR_M[0]), _NEAR_M[1])
        if self._near_s > 0.0 or ahead.first_row - now.row < near_m:
            self._near_s += now.elapsed_s
        if self.current is not None and not ahead.moving and self.current.ends_row > ahead.last_row:
            return None
        k = min(now.scene.index(now.row), now.scene.count - 2)
        lane_m = float(lane[k] + (now.row - k) * (lane[k + 1] - lane[k]))
        for way in ways_around(now.scene, ahead, now.row, now.right_m - lane_m, speed_mps=now.speed_mps):
            if self.current is not None or self._may_begin(way, lane, now):
                self.current, self._doubts = way, 0
                return None
        return ahead

    def stop_row(self, obstacle: Obstacle | None, now: Situation) -> float:
        """Return the row at which the front bumper waits for a way around, infinite without an obstacle."""
        if obstacle is None or (obstacle.moving and self._near_s >= _BORROW_AFTER_S):
            return math.inf
        front = now.row + now.scene.half_length_m
        wait = obstacle.first_row - _WAIT_BEFORE_M
        if front < wait + 0.3:
            return wait
        return front if now.speed_mps < 1.0 else min(front + _halt_m(now), obstacle.first_row - 1.0)

    def _may_begin(self, way: Pass, lane: Floats, now: Situation) -> bool:
        if way.starts_row > now.row + _EARLY_M or (way.oncoming and self._near_s < _BORROW_AFTER_S):
            return False
        return _is_pass_free(way, lane, now)

    def _gives_up(self, way: Pass, lane: Floats, now: Situation) -> bool:
        """Return whether a pass from which the ego can still stop is no longer free for several ticks on end."""
        if now.row + _halt_m(now) > way.beside_row:
            return False
        if _is_pass_free(way, lane, now):
            self._doubts = 0
        else:
            self._doubts += now.ticks if self._doubts else 1
        return self._doubts > _DOUBTS


def _is_pass_free(way: Pass, lane: Floats, now: Situation) -> bool:
    return is_free(now, lane + way.shift, min(way.ends_row, now.row + _LOOK_M))


def _halt_m(now: Situation) -> float:
    """Return the metres in which the ego can stop gently."""
    return now.speed_mps * now.speed_mps / (2.0 * _HALT_MPS2)
