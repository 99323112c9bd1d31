"""A route laid on its town: one row per metre, the lanes of the route, and the sparse plan for agents."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import groupby, islice, pairwise
from math import fsum

import numpy as np

from pytest_drive_robust.arithmetic import arrays, scalars
from pytest_drive_robust.domain.route import GlobalPlan, PlanPoint, RoadOption, Route
from pytest_drive_robust.domain.truth import LaneMap
from pytest_drive_robust.errors import RouteError, UsageError
from pytest_drive_robust.jit.arrays import Floats, Ints
from pytest_drive_robust.simulators.embedded.geometry import arc_lengths, project, resample
from pytest_drive_robust.simulators.embedded.map import CompiledTown, Passage, compile_town, follow, join, turn_of
from pytest_drive_robust.simulators.embedded.matching import distance_to_lanes, lane_change_side, match_lanes
from pytest_drive_robust.simulators.embedded.traced.schema import is_traced
from pytest_drive_robust.simulators.embedded.traced.traced_route import TRIGGER_OFF_M, trace_route

_SHORTEST_M, _LONGEST_M = 20.0, 20_000.0
"""Limits of the route length; a shorter route would be completed at its start."""
_ROUNDED_M = 0.5
"""Tolerance for a trigger whose rounding puts it beyond either end of the route."""
_OFF_CENTRE_M = 0.1
"""A lane change begins and ends where the route is nearer than this to the centre of a lane."""


@dataclass(frozen=True, slots=True)
class DenseRoute:
    """A route by rows: `rows` (n, 4) x, y, yaw, speed limit; `s` (n,) metres along it; `lanes` (n,) the lane below."""

    route: Route
    rows: Floats
    s: Floats
    lanes: Ints
    trigger_m: float
    town: CompiledTown

    @property
    def lane_map(self) -> LaneMap:
        """The lane map of the route's town."""
        return self.town.lane_map

    @property
    def length_m(self) -> float:
        """Length of the route in metres."""
        return float(self.s[-1])

    def driven_line(self) -> tuple[Floats, float]:
        """Return the line: road before the route + route with lane changes + road after; and the route's start [m]."""
        used = tuple(lane for lane, _ in groupby(int(k) for k in self.lanes))
        behind, ahead = follow(self.lane_map, used[0]), follow(self.lane_map, used[-1])
        before = join(self.lane_map, behind[: behind.index(used[0]) + 1])
        after = join(self.lane_map, ahead[ahead.index(used[-1]) :])
        first, last = self.rows[0], self.rows[-1]
        before = before[arc_lengths(before) < project(before, *first[:2])[0] - 0.5]
        after = after[arc_lengths(after) > project(after, *last[:2])[0] + 0.5]
        line = resample(np.concatenate([before[:, :2], self.rows[:, :2], after[:, :2]]))
        return line, project(line, *first[:2])[0]

    def first_junction_row(self) -> int | None:
        """Return the first row on a junction lane, or None."""
        flags = np.array([self.lane_map.lanes[k].junction for k in self.lanes])
        return int(np.argmax(flags)) if flags.any() else None

    def passages(self) -> tuple[Passage, ...]:
        """Return the route's ways through junctions in order; a junction crossed over turning lanes is left out."""
        found: list[Passage] = []
        for driven in self._junction_lanes():
            # a route that begins or ends within a junction drives only the end or the beginning of a way
            parts = ((way, way.inside[: len(driven)], way.inside[-len(driven) :]) for way in self.town.passages)
            found.extend(islice((way for way, first, last in parts if driven in (first, last)), 1))
        return tuple(found)

    def first_passage(self) -> Passage | None:
        """Return the way through the first junction, or None."""
        return next(iter(self.passages()), None)

    def junction_stops(self, number: int = 0) -> tuple[int, ...]:
        """Return the stop lines at the entries of the route's junction `number`."""
        junction = self.passages()[number].junction
        entries = {way.enters for way in self.town.passages if way.junction == junction}
        return tuple(line.index for line in self.lane_map.stop_lines if line.lane in entries)

    def plan(self) -> GlobalPlan:
        """Return the plan; `dense` has only the ends of a lane change, which CARLA's planner makes in one step."""
        commands = self._commands()
        way = [
            PlanPoint(float(x), float(y), command) for (x, y), command in zip(self.rows[:, :2], commands, strict=True)
        ]
        within = {k for start, end, _ in self.lane_changes() for k in range(start + 1, end - 1)}
        return GlobalPlan.of(way, self.s.tolist(), tuple(point for k, point in enumerate(way) if k not in within))

    def _junction_lanes(self) -> list[tuple[int, ...]]:
        """Return for each junction on the route the lanes used in it, in order."""
        runs = groupby((int(k) for k in self.lanes), key=lambda k: self.town.junctions.get(k, -1))
        return [tuple(dict.fromkeys(run)) for junction, run in runs if junction >= 0]

    def _commands(self) -> list[RoadOption]:
        """Return the navigation command of each row."""
        commands = [RoadOption.LANE_FOLLOW] * len(self.rows)
        for inside in self._junction_lanes():
            command = RoadOption.through_junction(turn_of(self.lane_map.lanes, inside))
            for k in np.flatnonzero(np.isin(self.lanes, inside)):
                commands[k] = command
        for start, end, side in self.lane_changes():
            option = RoadOption.CHANGE_LANE_RIGHT if side > 0 else RoadOption.CHANGE_LANE_LEFT
            commands[start:end] = [option] * (end - start)
        return commands

    def lane_changes(self) -> list[tuple[int, int, int]]:
        """Return (first row, row after the last, 1 to the right or -1 to the left) of every lane change."""
        lanes = self.lane_map.lanes
        changes: list[tuple[int, int, int]] = []
        if len(set(self.lanes.tolist())) == 1:
            return changes
        aside = [abs(project(lanes[k].centre, x, y)[1]) for k, (x, y) in zip(self.lanes, self.rows[:, :2], strict=True)]
        for row in np.flatnonzero(np.diff(self.lanes)):
            side = lane_change_side(lanes, int(self.lanes[row]), int(self.lanes[row + 1]))
            if side:
                start, end = int(row), int(row) + 1
                while start > 0 and aside[start] > _OFF_CENTRE_M:
                    start -= 1
                while end < len(aside) - 1 and aside[end] > _OFF_CENTRE_M:
                    end += 1
                changes.append((start, end, side))
        return changes


def _own_town(route: Route) -> CompiledTown:
    try:
        return compile_town(route.town)
    except UsageError as error:
        raise type(error)(f"route {route.id}: {error}") from None


def lay_route(route: Route) -> DenseRoute:
    """Lay a route on its town. Raises `RouteError` when the route leaves the town's driving lanes.

    A leaderboard route names a town of CARLA's; its town is built around the route.
    """
    if len(route.waypoints) < 2:
        raise RouteError(f"route {route.id}: {len(route.waypoints)} waypoint(s), expected at least 2")
    steps = pairwise(route.waypoints)
    length = fsum(scalars.hypot(b.x_m - a.x_m, b.y_m - a.y_m) for a, b in steps)
    if not _SHORTEST_M <= length <= _LONGEST_M:
        raise RouteError(
            f"route {route.id}: its waypoints are {length:.3g} m long, expected {_SHORTEST_M:.0f} to {_LONGEST_M:.0f} m"
        )
    traced = trace_route(route) if is_traced(route.town) else None
    town = _own_town(route) if traced is None else traced.town
    lane_map = town.lane_map
    line = traced.line if traced else resample(np.array([[point.x_m, point.y_m] for point in route.waypoints]))
    lanes = match_lanes(lane_map, line)
    if (lanes < 0).any():
        x, y = (float(value) for value in line[int(np.argmin(lanes)), :2])
        raise RouteError(
            f"route {route.id}: waypoint ({x:.1f}, {y:.1f}) is {distance_to_lanes(lane_map, x, y):.1f} m from the "
            f"nearest lane of town {route.town!r}; expected half a lane and 0.5 m at most, on a lane that leads the "
            "route's way"
        )
    limits = np.array([lane_map.lanes[k].speed_limit_mps for k in lanes])
    rows = np.column_stack([line, limits])
    trigger_m = traced.trigger_m if traced else _trigger_m(route, line)
    return DenseRoute(route, rows, arc_lengths(line), lanes, trigger_m, town)


def _trigger_m(route: Route, line: Floats) -> float:
    """Return where the scenario starts, in metres along the route. Raises `RouteError` when the trigger is off it."""
    trigger = route.scenario.trigger
    along, _ = project(line, trigger.x_m, trigger.y_m)
    off = float(arrays.hypot(line[:, 0] - trigger.x_m, line[:, 1] - trigger.y_m).min())
    length = float(arc_lengths(line)[-1])
    if not (off <= TRIGGER_OFF_M and -_ROUNDED_M <= along <= length + _ROUNDED_M):
        raise RouteError(
            f"route {route.id}: <trigger_point> ({trigger.x_m:.1f}, {trigger.y_m:.1f}) is {off:.1f} m from its "
            f"waypoints, {along:.1f} m from the start; expected {TRIGGER_OFF_M:.0f} m at most, and between 0 and the "
            f"{length:.1f} m of the route: elsewhere its scenario would never start"
        )
    return along
