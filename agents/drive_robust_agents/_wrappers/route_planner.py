"""The route planner of the published agents, which chooses the next target by raw positions.

The planner makes these agents fragile under GPS noise: positions are not filtered, and a point of the sparse plan is
dropped for good as soon as one measured position lies near it. A jump of the GPS can drop a point too early; with much
noise a point may never come near enough, or only by chance.

Source: Bench2DriveZoo `team_code/planner.py` and SimLingo `team_code/nav_planner.py`, re-written from their semantics.
"""

from __future__ import annotations

from typing import NamedTuple

from pytest_drive_robust import GlobalPlan, RoadOption
from pytest_drive_robust.arithmetic import scalars

__all__ = ["MAX_M", "MIN_M", "MIN_SIMLINGO_M", "RoutePlanner", "Target", "to_ego"]

MIN_M, MIN_SIMLINGO_M, MAX_M = 4.0, 7.5, 50.0


class Target(NamedTuple):
    """The next plan point with its command, and the plan point after it, metres in the route's frame."""

    x_m: float
    y_m: float
    command: RoadOption
    next_x_m: float
    next_y_m: float

    def seen_from(self, x_m: float, y_m: float, yaw_rad: float) -> tuple[tuple[float, float], tuple[float, float]]:
        """Return ((forward, right), (forward, right)) of both points in metres, from a pose in the route's frame."""
        return to_ego(self.x_m - x_m, self.y_m - y_m, yaw_rad), to_ego(
            self.next_x_m - x_m, self.next_y_m - y_m, yaw_rad
        )


class RoutePlanner:
    """Drops the reached points of a sparse plan, and returns the next two points.

    A step examines the points within `max_m` along the plan. Of the points within `min_m` of the position, the farthest
    counts as reached, and all points before it are dropped; the last two points always stay. The reached point is then
    the first point, the target the second, the next target the third (at the end of the plan the second again). Raises
    `ValueError` for a plan without points.

    >>> from pytest_drive_robust.domain.route import PlanPoint
    >>> plan = GlobalPlan(tuple(PlanPoint(10.0 * k, 0.0, RoadOption.LANE_FOLLOW) for k in range(4)))
    >>> planner = RoutePlanner(plan)
    >>> planner.step(5.9, 0.0).x_m, planner.step(6.0, 0.0).x_m, planner.step(0.0, 0.0).x_m
    (10.0, 20.0, 20.0)
    """

    def __init__(self, plan: GlobalPlan, *, min_m: float = MIN_M, max_m: float = MAX_M) -> None:
        if not plan.points:
            raise ValueError("the plan has no points, expected at least one: was reset called?")
        self._points = tuple((point.x_m, point.y_m, point.command) for point in plan.points)
        self._gaps_m = tuple(
            scalars.hypot(b[0] - a[0], b[1] - a[1]) for a, b in zip(self._points, self._points[1:], strict=False)
        )
        self._min_m, self._max_m = min_m, max_m
        self.dropped = 0
        """How many points are behind: may be read, kept, and set back to return to a moment of the episode."""

    def step(self, x_m: float, y_m: float) -> Target:
        """Return the target for a measured position (metres, route's frame)."""
        points, first = self._points, self.dropped
        reached, farthest, along = first, -1.0, 0.0
        for k in range(first + 1, len(points)):
            if along > self._max_m:
                break
            along += self._gaps_m[k - 1]
            away = scalars.hypot(points[k][0] - x_m, points[k][1] - y_m)
            if farthest < away <= self._min_m:
                reached, farthest = k, away
        self.dropped = min(reached, max(len(points) - 2, first))
        last = len(points) - 1
        next_x_m, next_y_m, _ = points[min(self.dropped + 2, last)]
        return Target(*points[min(self.dropped + 1, last)], next_x_m, next_y_m)


def to_ego(dx_m: float, dy_m: float, yaw_rad: float) -> tuple[float, float]:
    """Return (forward, right) metres of a difference in the route's frame."""
    c, s = scalars.cos_sin(yaw_rad)
    return c * dx_m + s * dy_m, c * dy_m - s * dx_m
