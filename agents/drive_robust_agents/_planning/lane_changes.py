"""Choose the ego's lanes: the route's lanes, changed in a gap, and the lane that frees the way for a siren."""

from __future__ import annotations

import math

import numpy as np

from drive_robust_agents._planning import columns as box
from drive_robust_agents._planning.lateral import blend
from drive_robust_agents._planning.projection import project_all
from drive_robust_agents._planning.static_scene import Change, StaticScene
from drive_robust_agents._planning.traffic import Traffic
from pytest_drive_robust.arithmetic.scalars import cos, sin
from pytest_drive_robust.domain.truth import ActorKind, LaneKind, WorldState
from pytest_drive_robust.jit.arrays import Floats

__all__ = ["LaneChanges", "Siren"]

_EARLY_M = 45.0
"""Distance before the route's lane change at which the ego may already change."""
_CHANGE_S, _SHORTEST_M, _LONGEST_M = 2.4, 13.0, 60.0
_SHORT_WINDOW_M = 25.0
_STOP_BEFORE_END_M = 13.0
_BESIDE_M = 60.0
_EMERGENCY, _PEDESTRIAN = int(ActorKind.EMERGENCY), int(ActorKind.PEDESTRIAN)


class LaneChanges:
    """The lane changes of the route in order; each begins as soon as it is free."""

    def __init__(self, scene: StaticScene) -> None:
        self.scene = scene
        self._left = [change for change in scene.changes if change.last - change.first > _SHORT_WINDOW_M]
        self._settled = np.zeros(scene.count)
        self.busy_until_row = self._ends_row = -1.0
        self.profile: Floats = self._waiting()

    @property
    def pending(self) -> Change | None:
        """The next lane change, or None."""
        return self._left[0] if self._left else None

    def candidate(self, row: float, speed_mps: float) -> Floats | None:
        """Return the profile that changes lanes now, or None when that would be too early."""
        change = self.pending
        if change is None or row < max(change.first + 1, change.start - _EARLY_M):
            return None
        length = min(max(_CHANGE_S * speed_mps, _SHORTEST_M), _LONGEST_M)
        end = row + max(min(length, change.last - 2.0 - row), 6.0)
        self._ends_row = end
        return self._changed(change, row, end)

    def adopt(self, profile: Floats) -> None:
        """Make `profile`, the latest candidate, the current lane change."""
        self.busy_until_row = self._ends_row
        self._left.pop(0)
        self._settled = profile
        self.profile = self._waiting()

    def stop_row(self) -> float:
        """Return the row that the front bumper must not pass in the lane that is to be left."""
        return math.inf if self.pending is None else self.pending.last - _STOP_BEFORE_END_M

    def traffic_mps(self, traffic: Traffic, row: float) -> float | None:
        """Return the mean traffic speed [m/s] near the ego in the new lane; None without traffic or too early."""
        change = self.pending
        if change is None or row < max(change.first - 30.0, change.start - _EARLY_M):
            return None
        at = project_all(self.scene.route, int(row - _BESIDE_M), int(row + _BESIDE_M), traffic.boxes)
        rows = np.clip(at[:, 0], 0, self.scene.count - 1).astype(int)
        heading = self.scene.cosines[rows], self.scene.sines[rows]
        along = traffic.boxes[:, box.COS] * heading[0] + traffic.boxes[:, box.SIN] * heading[1] > 0.8
        beside = np.abs(at[:, 1] - change.new[rows]) < 1.5
        close = np.abs(at[:, 0] - row) < _BESIDE_M
        speeds = traffic.boxes[along & beside & close & (traffic.kinds < _PEDESTRIAN), box.SPEED]
        return math.fsum(speeds) / len(speeds) if len(speeds) else None

    def _waiting(self) -> Floats:
        """Return the profile that stays in the lane until the next change begins."""
        change = self.pending
        if change is None:
            return self._settled
        rows = self.scene.rows
        return np.where((rows >= change.start) & (rows <= change.last), change.old, self._settled)

    def _changed(self, change: Change, start: float, end: float) -> Floats:
        rows = self.scene.rows
        share = blend(rows, start, end)
        within = (rows >= change.first) & (rows <= change.last)
        changed = (1.0 - share) * np.where(rows < change.start, self._settled, change.old) + share * change.new
        return np.where(within, changed, np.where(rows < change.first, self._settled, 0.0))


class Siren:
    """Clears the lane for an emergency vehicle behind the ego, and returns once that vehicle has passed."""

    _APPROACH_M, _PASSED_M, _SHIFT_M = 70.0, 12.0, 24.0

    def __init__(self) -> None:
        self._aside: Floats | None = None

    @property
    def active(self) -> bool:
        """Whether the ego has moved aside."""
        return self._aside is not None

    def shifts(self, scene: StaticScene, traffic: Traffic, world: WorldState, row: float) -> list[Floats]:
        """Return profiles to add to the lane's own that clear the lane, best first; none without a siren behind."""
        if self.active:
            return []
        ahead = self._metres_ahead(traffic, world)
        if ahead is None or not -self._APPROACH_M < ahead < -3.0:
            return []
        share = blend(scene.rows, row, row + self._SHIFT_M)
        return [share * aside for aside in _free_sides_m(scene, row)]

    def step_aside(self, profile: Floats) -> None:
        """Hold this profile until the siren has passed."""
        self._aside = profile

    def profile(self, traffic: Traffic, world: WorldState) -> Floats | None:
        """Return the profile to add to the lane's own profile now, or None."""
        if self._aside is None:
            return None
        ahead = self._metres_ahead(traffic, world)
        if ahead is None or ahead > self._PASSED_M:
            self._aside = None
        return self._aside

    @staticmethod
    def _metres_ahead(traffic: Traffic, world: WorldState) -> float | None:
        ego = world.ego
        if _EMERGENCY not in traffic.kinds:
            return None
        c, s = cos(ego.yaw_rad), sin(ego.yaw_rad)
        for siren in traffic.boxes[traffic.kinds == _EMERGENCY]:
            if siren[box.COS] * c + siren[box.SIN] * s > 0.7 and siren[box.SPEED] > 1.0:
                return float((siren[box.X] - ego.x_m) * c + (siren[box.Y] - ego.y_m) * s)
        return None


def _free_sides_m(scene: StaticScene, row: float) -> list[float]:
    """Return sideways metres that clear the lane: to the right lane, to the left lane, else to the right edge."""
    found = []
    for side, sign in (("right", 1.0), ("left", -1.0)):
        lane, same_way = scene.neighbour(row, side)
        if lane is not None and same_way:
            found.append(sign * lane.width_m)
    here = scene.lane_at(row)
    if not found and here.right >= 0 and scene.lane_map.lanes[here.right].kind is LaneKind.PARKING:
        found.append(0.5 * (here.width_m + scene.lane_map.lanes[here.right].width_m))
    return found or [0.5 * here.width_m]
