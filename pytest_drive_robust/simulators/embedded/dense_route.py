"""A route laid on its town: one row a metre, the lanes that it uses, and the sparse plan that agents get."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pytest_drive_robust.domain.route import GlobalPlan, PlanPoint, RoadOption, Route
from pytest_drive_robust.domain.truth import LaneKind, LaneMap
from pytest_drive_robust.errors import RouteError
from pytest_drive_robust.simulators.embedded.geometry import arc_lengths, project, resample
from pytest_drive_robust.simulators.embedded.map import compile_town, follow, join

__all__ = ["DenseRoute", "lay_route"]

Floats = NDArray[np.float64]
_MAX_PLAN_GAP_M = 50.0
_ON_LANE_M = 1.5
_TURN_RAD = np.radians(35.0)


@dataclass(frozen=True, slots=True)
class DenseRoute:
    """`rows` is (n, 4): x, y, yaw, speed limit; `s` (n,) the distance; `lanes` (n,) the lane under each row."""

    route: Route
    lane_map: LaneMap
    rows: Floats
    s: Floats
    lanes: NDArray[np.int64]
    trigger_m: float

    @property
    def length_m(self) -> float:
        """Length of the route in metres."""
        return float(self.s[-1])

    def chain(self) -> tuple[int, ...]:
        """The lanes of the route in order, prolonged to where the first road begins and the last one ends."""
        used = list(dict.fromkeys(int(k) for k in self.lanes))
        before = follow(self.lane_map, used[0])
        after = follow(self.lane_map, used[-1])
        head = before[: before.index(used[0])]
        tail = after[after.index(used[-1]) + 1 :]
        return (*head, *used, *tail)

    def driven_line(self) -> tuple[Floats, float]:
        """(centre line of `chain`, where on it the route starts)."""
        line = join(self.lane_map, self.chain())
        return line, project(line, float(self.rows[0, 0]), float(self.rows[0, 1]))[0]

    def first_junction_row(self) -> int | None:
        """The first row on a junction lane, or None."""
        flags = np.array([self.lane_map.lanes[k].junction for k in self.lanes])
        return int(np.argmax(flags)) if flags.any() else None

    def plan(self) -> GlobalPlan:
        """Points where the command changes and at least one every 50 m, as the leaderboard downsamples."""
        commands = [self._command(k) for k in range(len(self.rows))]
        points: list[PlanPoint] = []
        last_s = -np.inf
        for k, command in enumerate(commands):
            changed = not points or command is not points[-1].command
            if changed or self.s[k] - last_s >= _MAX_PLAN_GAP_M or k == len(commands) - 1:
                points.append(PlanPoint(float(self.rows[k, 0]), float(self.rows[k, 1]), command))
                last_s = float(self.s[k])
        return GlobalPlan(tuple(points))

    def _command(self, k: int) -> RoadOption:
        lane = self.lane_map.lanes[self.lanes[k]]
        if not lane.junction:
            return RoadOption.LANE_FOLLOW
        turn = lane.centre[-1, 2] - lane.centre[0, 2]
        if abs(turn) < _TURN_RAD:
            return RoadOption.STRAIGHT
        return RoadOption.RIGHT if turn > 0.0 else RoadOption.LEFT


def lay_route(route: Route) -> DenseRoute:
    """Lay a route on its town. Raises `RouteError` when it leaves the town's driving lanes."""
    if len(route.waypoints) < 2:
        raise RouteError(f"route {route.id}: {len(route.waypoints)} waypoint(s), expected at least 2")
    lane_map = compile_town(route.town).lane_map
    line = resample(np.array([[point.x_m, point.y_m] for point in route.waypoints]))
    lanes = _match(lane_map, line, route)
    limits = np.array([lane_map.lanes[k].speed_limit_mps for k in lanes])
    rows = np.column_stack([line, limits])
    trigger = route.scenario.trigger
    trigger_m = project(line, trigger.x_m, trigger.y_m)[0]
    return DenseRoute(route, lane_map, rows, arc_lengths(line), lanes, trigger_m)


def _match(lane_map: LaneMap, line: Floats, route: Route) -> NDArray[np.int64]:
    """The driving lane under each row: near, heading the same way; a lane that was entered is kept while it fits."""
    driving = [lane for lane in lane_map.lanes if lane.kind is LaneKind.DRIVING]
    points = np.concatenate([lane.centre for lane in driving])
    owner = np.concatenate([np.full(len(lane.centre), lane.index) for lane in driving])
    found = np.empty(len(line), dtype=np.int64)
    for k, (x, y, heading) in enumerate(line):
        away = np.hypot(points[:, 0] - x, points[:, 1] - y)
        cost = away + 3.0 * (1.0 - np.cos(points[:, 2] - heading))
        # at forks several lanes share their first metres: the end of the route decides which one was meant
        best = int(np.argmin(cost))
        if away[best] > _ON_LANE_M:
            raise RouteError(
                f"route {route.id}: waypoint ({x:.1f}, {y:.1f}) is {away[best]:.1f} m from the nearest lane of town "
                f"{route.town!r}, expected at most {_ON_LANE_M} m"
            )
        found[k] = owner[best]
    return _clean_forks(lane_map, found)


def _clean_forks(lane_map: LaneMap, found: NDArray[np.int64]) -> NDArray[np.int64]:
    """Within a junction keep the connector that the route uses longest; its siblings share only the first metres."""
    junction = np.array([lane_map.lanes[k].junction for k in found])
    cleaned: NDArray[np.int64] = found.copy()
    start = 0
    for k in range(1, len(found) + 1):
        if k == len(found) or junction[k] != junction[start]:
            if junction[start]:
                values, counts = np.unique(found[start:k], return_counts=True)
                cleaned[start:k] = values[np.argmax(counts)]
            start = k
    return cleaned
