"""What stands in the way: foreign points against the path, as free metres ahead and a step aside."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

__all__ = ["Corridor", "beside", "oncoming"]

Floats = NDArray[np.float64]

_RANGE_M = 34.0
_LEFT_M, _RIGHT_M = 1.3, 1.5
_BODY_M, _NARROW_M = 1.2, 1.15
_ASIDE_MOST_M, _SQUEEZE_M = 1.2, 0.15
_ASIDE_RATE_MPS = 0.9
_DEPTH_M = 2.5
_BESIDE_M = 7.0
_HOLD_S = 0.25
_STEADY_S = 0.4
_DRIFT_MPS = -0.7
_POST_M = 0.4
_POST_ROOM_M = 0.8
_ONCOMING_M = (4.5, 34.0)
_DT_S = 0.05


class Corridor:
    """Free distance along the path, with a short memory, and how far to keep to the left of something at the edge.

    `free_m` is measured from the middle of the vehicle, infinity when nothing is seen; `aside_m` is 0 or negative
    (left); `tight` says that something stands close to the right edge.
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
        *,
        may_dodge: bool,
        no_posts: bool = False,
        narrow: bool = False,
    ) -> None:
        """Compare foreign points (k, 2) with the path (n, 2), a point a metre, both in the vehicle's frame.

        `no_posts` takes no notice of thin things, `narrow` keeps no room beside the vehicle.
        """
        along, right = beside(bases, path)
        near = (along > 1.0) & (along < _RANGE_M)
        along, right = along[near], right[near]
        self.tight = bool(np.any((right > 0.0) & (right < 2.4) & (along < 22.0)))
        self._follow_edge(along, right, travelled_m, may_dodge)
        left_m, right_m = (_NARROW_M, _NARROW_M) if narrow else (_LEFT_M, _RIGHT_M)
        blocking = (right > -left_m + min(self.aside_m, 0.0)) & (right < right_m)
        if self._passable():
            blocking &= right < self._aside_wanted_m + _BODY_M
        if no_posts and blocking.any():
            blocking &= ~_posts(along, right)
        self._remember(np.sort(along[blocking]), travelled_m)

    def _follow_edge(self, along: Floats, right: Floats, travelled_m: float, may_dodge: bool) -> None:
        """Track the left edge of the first thing to the right of the middle; step aside when it keeps still."""
        self._aside_for_m = max(0.0, self._aside_for_m - travelled_m)
        candidates = (right > -1.0) & (right < _RIGHT_M + 0.2)
        if candidates.sum() >= 2:
            first = float(np.sort(along[candidates])[1])
            edge = float(right[candidates & (along < first + _DEPTH_M)].min())
            if abs(edge - self._edge_m) > 1.0:
                self._edge_m, self._drift_mps, self._edge_s = edge, 0.0, 0.0
            missed = edge - (self._edge_m + self._drift_mps * _DT_S)
            self._edge_m += self._drift_mps * _DT_S + 0.3 * missed
            self._drift_mps += 0.05 * missed / _DT_S
            self._edge_s += _DT_S
            if self._passable() and may_dodge:
                self._aside_wanted_m = max(-_ASIDE_MOST_M, min(self._edge_m - _RIGHT_M, 0.0))
                self._aside_for_m = first + _DEPTH_M + _BESIDE_M
        else:
            self._edge_m, self._edge_s = math.inf, 0.0
        wanted = self._aside_wanted_m if self._aside_for_m > 0.0 and may_dodge else 0.0
        most = _ASIDE_RATE_MPS * _DT_S
        self.aside_m += min(max(wanted - self.aside_m, -most), most)

    def _passable(self) -> bool:
        room = self._edge_m - _BODY_M > _SQUEEZE_M - _ASIDE_MOST_M
        return room and self._edge_s > _STEADY_S and self._drift_mps > _DRIFT_MPS

    def _remember(self, blocked_m: Floats, travelled_m: float) -> None:
        """Update the free distance: two columns make an obstacle; one that is lost counts a moment longer."""
        self.free_m -= travelled_m
        if len(blocked_m) >= 2:
            self.free_m, self._unseen_s = float(blocked_m[1]), 0.0
            return
        self._unseen_s += _DT_S
        if self._unseen_s > _HOLD_S:
            self.free_m = math.inf


def oncoming(bases: Floats) -> bool:
    """Return whether something comes along the lane to the left, so near that it would meet a left turn."""
    forward, right = bases[:, 0], bases[:, 1]
    inside = (forward > _ONCOMING_M[0]) & (forward < _ONCOMING_M[1]) & (right > -7.0) & (right < -_LEFT_M)
    if not inside.any():
        return False
    return bool((inside & ~_posts(forward, right)).sum() >= 2)


def _posts(along: Floats, right: Floats) -> NDArray[np.bool_]:
    """Return which points belong to something thinner than anything that moves: nothing else is near them."""
    together = np.hypot(along[:, None] - along, right[:, None] - right) < _POST_ROOM_M
    spread = np.where(together, right, -np.inf).max(axis=1) - np.where(together, right, np.inf).min(axis=1)
    thin: NDArray[np.bool_] = spread < _POST_M
    return thin


def beside(bases: Floats, path: Floats) -> tuple[Floats, Floats]:
    """Return (metres along the path, metres to its right) of points (k, 2)."""
    dx = bases[:, 0, None] - path[:, 0]
    dy = bases[:, 1, None] - path[:, 1]
    nearest = np.argmin(dx * dx + dy * dy, axis=1)
    steps = np.gradient(path, axis=0)
    heading = np.arctan2(steps[:, 1], steps[:, 0])[nearest]
    rows = np.arange(len(bases))
    ahead, side = dx[rows, nearest], dy[rows, nearest]
    lengths = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(path, axis=0).T))))
    along = lengths[nearest] + ahead * np.cos(heading) + side * np.sin(heading)
    return along, side * np.cos(heading) - ahead * np.sin(heading)
