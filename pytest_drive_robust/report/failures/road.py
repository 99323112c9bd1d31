"""Locates the ego on its road: the row of the route beside it, its lane, and whether it is off the road."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pytest_drive_robust.arithmetic.series import wrap_angle
from pytest_drive_robust.domain.truth import GroundTruth, LaneKind
from pytest_drive_robust.jit.arrays import Floats

_OUTSIDE_M = 0.5
"""Metres beyond the lane's edge that count as outside, as in the criterion of the leaderboard."""
_WINDOW_ROWS = 25


class LaneView(NamedTuple):
    """The nearest lane of n places, each (n,): metres beyond its edge, its heading, whether it is in a junction."""

    beyond_m: Floats
    heading_rad: Floats
    junction: NDArray[np.bool_]

    @property
    def outside(self) -> NDArray[np.bool_]:
        """True where the middle of the ego was outside every lane."""
        return self.beyond_m > _OUTSIDE_M


class Road:
    """The lanes and the route of an episode."""

    def __init__(self, truth: GroundTruth) -> None:
        self.route: Floats = truth.route
        lanes = [lane for lane in truth.lane_map.lanes if lane.kind in (LaneKind.DRIVING, LaneKind.PARKING)]
        self._points: Floats = np.concatenate([lane.centre for lane in lanes]) if lanes else np.zeros((0, 3))
        counts = [len(lane.centre) for lane in lanes]
        self._widths = np.repeat(np.array([lane.width_m for lane in lanes]), counts)
        self._junction = np.repeat(np.array([lane.junction for lane in lanes], bool), counts)

    def lanes_at(self, places: Floats) -> LaneView:
        """Return the nearest lane of each of the places (n, 2)."""
        if not len(self._points):
            nothing = np.zeros(len(places))
            return LaneView(nothing, nothing, nothing.astype(bool))
        nearest = [int(np.argmin(np.hypot(*(self._points[:, :2] - place).T))) for place in places]
        points = self._points[nearest]
        away = np.hypot(*(points[:, :2] - places).T)
        return LaneView(away - self._widths[nearest] / 2.0, points[:, 2], self._junction[nearest])

    def row_of(self, place: Floats, progress_m: float) -> int:
        """Return the row of the route nearest to `place`, searched around `progress_m` metres along the route."""
        at = int(np.clip(round(progress_m), 0, len(self.route) - 1))
        low, high = max(0, at - _WINDOW_ROWS), min(len(self.route), at + _WINDOW_ROWS + 1)
        return low + int(np.argmin(np.hypot(*(self.route[low:high, :2] - place).T)))

    def beside_m(self, place: Floats, row: int) -> float:
        """Return how many metres a place is to the right of the route."""
        x, y, yaw = self.route[row, :3]
        return float(-np.sin(yaw) * (place[0] - x) + np.cos(yaw) * (place[1] - y))

    def turn_rad(self, row: int, behind: int, ahead: int) -> float:
        """Return the angle by which the route turns right from `behind` rows before `row` to `ahead` rows after it."""
        first, last = max(0, row - behind), min(len(self.route) - 1, row + ahead)
        return float(np.sum(wrap_angle(np.diff(self.route[first : last + 1, 2]))))

    def in_junction(self, row: int, behind: int, ahead: int) -> bool:
        """Return True when the route passes a junction from `behind` rows before `row` to `ahead` rows after it."""
        rows = self.route[max(0, row - behind) : row + ahead + 1, :2]
        return bool(self.lanes_at(rows).junction.sum() >= 2)
