"""Compare foreign points with the path: free metres ahead, and a step aside for bodies at the edge."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from pytest_drive_robust.jit.arrays import Floats, Floats2
from pytest_drive_robust.jit.kernels import entry

__all__ = ["Corridor", "beside", "oncoming"]

_RANGE_M = 34.0
"""Bodies farther ahead along the path are ignored."""
_LEFT_M, _RIGHT_M = 1.3, 1.5
"""A body this far to the left or right of the path is in the way."""
_BODY_M, _NARROW_M = 1.2, 1.15
"""Room to the right of the path that a step aside leaves, and the room to both sides while passing."""
_ASIDE_MOST_M, _SQUEEZE_M = 1.2, 0.15
"""Largest step aside, and how much more room than that a body must leave."""
_ASIDE_RATE_MPS = 0.9
"""How fast the path steps aside and back."""
_DEPTH_M = 2.5
"""Points up to this much farther ahead belong to the same body."""
_BESIDE_M = 7.0
"""The step aside lasts this far beyond the body."""
_HOLD_S = 0.25
"""An obstacle out of sight counts for this long."""
_STEADY_S = 0.4
"""A body's edge must be seen for this long before the path steps aside."""
_DRIFT_MPS = -0.7
"""A body whose edge drifts faster to the left is on its way into the lane: the path does not step aside."""
_POST_M = 0.4
"""What is narrower is a post."""
_POST_ROOM_M = 0.8
"""Points within this distance of each other belong to one thing."""
_ONCOMING_M = (4.5, 34.0)
"""Metres ahead between which a body in the oncoming lane forbids a left turn."""


class Corridor:
    """Free distance along the path, with a short memory, and the step to the left of a body at the right edge.

    `free_m` is measured from the middle of the vehicle, infinity when nothing is seen. `aside_m` is 0 or negative
    (left). `tight` tells that a body stands close to the right edge.
    """

    def __init__(self) -> None:
        self.free_m = math.inf
        self.aside_m = 0.0
        self.tight = False
        self._unseen_s = 0.0
        self._edge_m, self._drift_mps, self._edge_s = math.inf, 0.0, 0.0
        self._aside_for_m, self._aside_wanted_m = 0.0, 0.0

    def update(
        self,
        bases: Floats,
        path: Floats,
        travelled_m: float,
        elapsed_s: float,
        *,
        may_dodge: bool,
        no_posts: bool = False,
        narrow: bool = False,
    ) -> None:
        """Update the corridor from foreign points (k, 2) and the path (n, 2), a point a metre, in the vehicle's frame.

        `travelled_m` and `elapsed_s` count from the last update. `no_posts` ignores thin things, `narrow` keeps no room
        beside the vehicle.
        """
        places = beside(bases, path)
        self.tight, seen, first, edge = _right_edge(places)
        self._follow_edge(seen, first, edge, travelled_m, elapsed_s, may_dodge)
        left_m, right_m = (_NARROW_M, _NARROW_M) if narrow else (_LEFT_M, _RIGHT_M)
        if self._passable():
            right_m = min(right_m, self._aside_wanted_m + _BODY_M)
        blocked = _second_blocking(places, min(self.aside_m, 0.0) - left_m, right_m, no_posts)
        self._remember(blocked, travelled_m, elapsed_s)

    def _follow_edge(
        self, seen: bool, first: float, edge: float, travelled_m: float, elapsed_s: float, may_dodge: bool
    ) -> None:
        """Track the left edge of the first body to the right of the middle; step aside when that edge stands still."""
        self._aside_for_m = max(0.0, self._aside_for_m - travelled_m)
        if seen:
            if abs(edge - self._edge_m) > 1.0:
                self._edge_m, self._drift_mps, self._edge_s = edge, 0.0, 0.0
            missed = edge - (self._edge_m + self._drift_mps * elapsed_s)
            self._edge_m += self._drift_mps * elapsed_s + 0.3 * missed
            self._drift_mps += 0.05 * missed / elapsed_s
            self._edge_s += elapsed_s
            if self._passable() and may_dodge:
                self._aside_wanted_m = max(-_ASIDE_MOST_M, min(self._edge_m - _RIGHT_M, 0.0))
                self._aside_for_m = first + _DEPTH_M + _BESIDE_M
        else:
            self._edge_m, self._edge_s = math.inf, 0.0
        wanted = self._aside_wanted_m if self._aside_for_m > 0.0 and may_dodge else 0.0
        most = _ASIDE_RATE_MPS * elapsed_s
        self.aside_m += min(max(wanted - self.aside_m, -most), most)

    def _passable(self) -> bool:
        room = self._edge_m - _BODY_M > _SQUEEZE_M - _ASIDE_MOST_M
        return room and self._edge_s > _STEADY_S and self._drift_mps > _DRIFT_MPS

    def _remember(self, blocked_m: float, travelled_m: float, elapsed_s: float) -> None:
        """Update the free distance; an obstacle that is out of sight counts a moment longer."""
        self.free_m -= travelled_m
        if blocked_m < math.inf:
            self.free_m, self._unseen_s = blocked_m, 0.0
            return
        self._unseen_s += elapsed_s
        if self._unseen_s > _HOLD_S:
            self.free_m = math.inf


def oncoming(bases: Floats) -> bool:
    """Return whether a body in the oncoming lane is so near that a left turn would meet it."""
    forward, right = bases[:, 0], bases[:, 1]
    inside = (forward > _ONCOMING_M[0]) & (forward < _ONCOMING_M[1]) & (right > -7.0) & (right < -_LEFT_M)
    if not inside.any():
        return False
    return bool((inside & ~_posts(forward, right)).sum() >= 2)


def _posts(along: Floats, right: Floats) -> NDArray[np.bool_]:
    """Return (k,) whether each point belongs to a thin post, thinner than any moving body: no other points near it."""
    ahead, aside = along[:, None] - along, right[:, None] - right
    together = ahead * ahead + aside * aside < _POST_ROOM_M * _POST_ROOM_M
    spread = np.where(together, right, -np.inf).max(axis=1) - np.where(together, right, np.inf).min(axis=1)
    thin: NDArray[np.bool_] = spread < _POST_M
    return thin


@entry
def beside(points: Floats2, path: Floats2) -> Floats:
    """Return (k, 2): metres along the path and metres to its right, of points (k, 2)."""
    count, last = len(path), len(path) - 1
    lengths, found = np.zeros(count), np.empty((len(points), 2))
    for n in range(1, count):
        dx, dy = path[n, 0] - path[n - 1, 0], path[n, 1] - path[n - 1, 1]
        lengths[n] = lengths[n - 1] + math.sqrt(dx * dx + dy * dy)
    for k in range(len(points)):
        best, n = np.inf, 0
        for other in range(count):
            dx, dy = points[k, 0] - path[other, 0], points[k, 1] - path[other, 1]
            if dx * dx + dy * dy < best:
                best, n = dx * dx + dy * dy, other
        before, after = max(n - 1, 0), min(n + 1, last)
        c, s = path[after, 0] - path[before, 0], path[after, 1] - path[before, 1]
        size = math.sqrt(c * c + s * s)
        c, s = (c / size, s / size) if size > 0.0 else (1.0, 0.0)
        dx, dy = points[k, 0] - path[n, 0], points[k, 1] - path[n, 1]
        found[k, 0], found[k, 1] = lengths[n] + dx * c + dy * s, dy * c - dx * s
    return found


@entry
def _right_edge(places: Floats2) -> tuple[bool, bool, float, float]:
    """Return (whether a body is close to the right, whether one is seen, its metres ahead, its left edge)."""
    tight, first, second, edge = False, np.inf, np.inf, np.inf
    for k in range(len(places)):
        along, right = places[k, 0], places[k, 1]
        if 1.0 < along < _RANGE_M:
            tight = tight or (0.0 < right < 2.4 and along < 22.0)
            if -1.0 < right < _RIGHT_M + 0.2:
                first, second = (along, first) if along < first else (first, min(second, along))
    for k in range(len(places)):
        along, right = places[k, 0], places[k, 1]
        if 1.0 < along < min(_RANGE_M, second + _DEPTH_M) and -1.0 < right < _RIGHT_M + 0.2:
            edge = min(edge, right)
    return tight, second < np.inf, second, edge


@entry
def _second_blocking(places: Floats2, left_m: float, right_m: float, no_posts: bool) -> float:
    """Return how far ahead the second of the points in the way is, infinity when there are fewer than two."""
    first, second = np.inf, np.inf
    for k in range(len(places)):
        along, right = places[k, 0], places[k, 1]
        if not (1.0 < along < _RANGE_M and left_m < right < right_m):
            continue
        if no_posts:
            low, high = right, right
            for other in range(len(places)):
                ahead, aside = places[other, 0] - along, places[other, 1] - right
                near = 1.0 < places[other, 0] < _RANGE_M and ahead * ahead + aside * aside < _POST_ROOM_M * _POST_ROOM_M
                if near:
                    low, high = min(low, places[other, 1]), max(high, places[other, 1])
            if high - low < _POST_M:
                continue
        first, second = (along, first) if along < first else (first, min(second, along))
    return second
