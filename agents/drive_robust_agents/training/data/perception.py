"""Labels of perception: boxes and future places of the actors that a camera sees, and the lines of the map."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drive_robust_agents.training.data.labels import ExpertMoment, to_ego
from pytest_drive_robust.domain.truth import ActorKind, EgoState, LaneKind, LaneMap, LightState, WorldState
from pytest_drive_robust.jit.arrays import Floats, Ints

__all__ = ["BOXES", "LANES", "ROUTE", "SOLID", "MapLines", "box_labels"]

BOXES, BOX_TICKS = 24, (10, 20, 30, 40, 50, 60)
LANES, LANE_POINTS = 12, 6
ROUTE, LANE, STRIPED, SOLID, STOP, CROSSWALK = range(6)
"""Values of `lane_kind`, whose names are `LANE_CLASSES`; -1 is none."""
_AHEAD_M, _BEHIND_M, _ASIDE_M = 64.0, 24.0, 32.0
_LANES_BEHIND_M = 16.0
_FASTEST_M = 20.0
"""Greatest motion of an actor in 0.5 s; beyond, the number belongs to another actor."""
_SHORTEST_M = 3.0
_BEND_M_PER_RAD = 15.0
"""Metres of straight line that get as many points as a bend of one radian."""
_ROUTE_ROWS = (30, 110)


def box_labels(states: Sequence[WorldState], seen: Collection[int]) -> dict[str, NDArray[Any]]:
    """Return `boxes` (24, 9) and `box_future` (24, 6, 2) of the actors in `seen`, nearest first, in the ego frame."""
    ego, actors = states[0].ego, states[0].actors
    places = to_ego(ego, actors[:, [WorldState.X, WorldState.Y]])
    inside = (places[:, 0] < _AHEAD_M) & (places[:, 0] > -_BEHIND_M) & (np.abs(places[:, 1]) < _ASIDE_M)
    inside &= np.isin(actors[:, WorldState.ID].astype(int), list(seen)) & (actors[:, WorldState.KIND] != ActorKind.DIRT)
    order = np.argsort(np.hypot(*places.T), kind="stable")
    chosen = order[inside[order]][:BOXES]
    boxes, future = np.zeros((BOXES, 9), np.float32), np.full((BOXES, len(BOX_TICKS), 2), np.nan, np.float32)
    for k, row in enumerate(actors[chosen]):
        turn = row[WorldState.YAW] - ego.yaw_rad
        boxes[k] = (
            *places[chosen[k]],
            np.sin(turn),
            np.cos(turn),
            row[WorldState.LENGTH],
            row[WorldState.WIDTH],
            row[WorldState.SPEED],
            row[WorldState.KIND],
            1.0,
        )
        future[k] = _track(states, int(row[WorldState.ID]), ego)
    return {"boxes": boxes, "box_future": future}


def _track(states: Sequence[WorldState], number: int, ego: EgoState) -> Floats:
    """Return (6, 2): the places of one actor after 0.5 ... 3 s; NaN after it has disappeared."""
    found = np.full((len(BOX_TICKS), 2), np.nan)
    last: Floats | None = None
    for k, tick in enumerate((0, *BOX_TICKS)):
        if tick >= len(states):
            break
        rows = states[tick].actors[states[tick].actors[:, WorldState.ID] == number]
        if len(rows) == 0:
            break
        place = rows[0, [WorldState.X, WorldState.Y]]
        if last is not None and float(np.hypot(*(place - last))) > _FASTEST_M:
            break
        last = place
        if k:
            found[k - 1] = place
    return to_ego(ego, found)


class MapLines:
    """The lines of a map as pieces of polyline with a kind each, cut to the ego's surroundings."""

    def __init__(self, lane_map: LaneMap) -> None:
        self._lines: list[tuple[int, Floats]] = []
        for lane in lane_map.lanes:
            if lane.kind is LaneKind.SIDEWALK:
                continue
            if lane.kind is LaneKind.DRIVING:
                self._lines.append((LANE, lane.centre[:, :2]))
            for side, style in ((-0.5, lane.left_line), (0.5, lane.right_line)):
                if style != "none":
                    kind = STRIPED if style == "striped" else SOLID
                    self._lines.append((kind, _beside(lane.centre, side * lane.width_m)))
        self._crosswalks = [(CROSSWALK, _middle(box)) for box in lane_map.crosswalks]
        self._stops = lane_map.stop_lines
        self._boxes = np.array([[*line.min(axis=0), *line.max(axis=0)] for _, line in self._lines])

    def labels(self, here: ExpertMoment) -> dict[str, NDArray[Any]]:
        """Return `lanes` (12, 6, 2), `lane_kind` (12,): the route, stop lines in force, crosswalks, then nearest."""
        ego, lights = here.ego, here.truth.state.lights
        row = here.truth.progress
        route = here.truth.route[max(0, row - _ROUTE_ROWS[0]) : row + _ROUTE_ROWS[1], :2]
        first = _cut([(ROUTE, route)], ego)[:1]
        stops = [(STOP, line) for line in self._stop_lines(lights)]
        signs = _nearest(_cut(stops, ego, shortest_m=0.5))[:2] + _nearest(_cut(self._crosswalks, ego))[:2]
        reach = _AHEAD_M + _ASIDE_M
        near = (self._boxes[:, :2] < np.array([ego.x_m, ego.y_m]) + reach).all(axis=1)
        near &= (self._boxes[:, 2:] > np.array([ego.x_m, ego.y_m]) - reach).all(axis=1)
        rest = _nearest(_cut([self._lines[k] for k in np.flatnonzero(near)], ego))
        lanes = np.full((LANES, LANE_POINTS, 2), np.nan, np.float32)
        kinds = np.full(LANES, -1, np.int8)
        for k, (kind, points) in enumerate((first + signs + rest)[:LANES]):
            lanes[k], kinds[k] = points, kind
        return {"lanes": lanes, "lane_kind": kinds}

    def _stop_lines(self, lights: Ints) -> list[Floats]:
        found = []
        for line in self._stops:
            if lights[line.index] in (LightState.RED, LightState.YELLOW, LightState.STOP_SIGN):
                half = 0.5 * line.width_m * np.array([-np.sin(line.heading_rad), np.cos(line.heading_rad)])
                middle = np.array([line.x_m, line.y_m])
                found.append(np.stack([middle - half, middle + half]))
        return found


def _middle(corners: Floats) -> Floats:
    """Return the middle line of a crosswalk (4, 2), the way that people walk, in steps of about half a metre."""
    sides = np.hypot(*(np.roll(corners, -1, axis=0) - corners).T)
    first = 0 if sides[0] + sides[2] < sides[1] + sides[3] else 1
    a, b = (0.5 * (corners[k] + corners[(k + 1) % 4]) for k in (first, first + 2))
    share = np.linspace(0.0, 1.0, 2 + int(2.0 * np.hypot(*(b - a))))[:, None]
    line: Floats = a + share * (b - a)
    return line


def _beside(centre: Floats, right_m: float) -> Floats:
    """Return the line `right_m` metres to the right of a line (n, 3) x, y, yaw."""
    return np.column_stack(
        [centre[:, 0] - right_m * np.sin(centre[:, 2]), centre[:, 1] + right_m * np.cos(centre[:, 2])]
    )


def _cut(
    lines: Sequence[tuple[int, Floats]], ego: EgoState, *, shortest_m: float = _SHORTEST_M
) -> list[tuple[int, Floats]]:
    """Return the pieces within the window, each as 6 points in the ego frame, without pieces below `shortest_m`."""
    found = []
    for kind, line in lines:
        points = to_ego(ego, line)
        inside = (points[:, 0] > -_LANES_BEHIND_M) & (points[:, 0] < _AHEAD_M) & (np.abs(points[:, 1]) < _ASIDE_M)
        edges = np.flatnonzero(np.diff(np.concatenate([[0], inside.astype(int), [0]])))
        for start, end in edges.reshape(-1, 2):
            piece = points[start:end]
            if len(piece) > 1 and float(np.hypot(*np.diff(piece, axis=0).T).sum()) >= shortest_m:
                found.append((kind, _six(piece)))
    return found


def _six(line: Floats) -> Floats:
    """Return six points along a line, closer together in bends."""
    steps = np.diff(line, axis=0)
    turns = np.abs(np.diff(np.unwrap(np.arctan2(steps[:, 1], steps[:, 0])), prepend=np.nan))
    weights = np.hypot(*steps.T) + _BEND_M_PER_RAD * np.nan_to_num(turns)
    s = np.concatenate([[0.0], np.cumsum(weights)])
    at = np.linspace(0.0, s[-1], LANE_POINTS)
    return np.column_stack([np.interp(at, s, line[:, 0]), np.interp(at, s, line[:, 1])])


def _nearest(pieces: list[tuple[int, Floats]]) -> list[tuple[int, Floats]]:
    """Return the pieces sorted by distance from the ego."""
    return sorted(pieces, key=lambda piece: _distance(piece[1]))


def _distance(points: Floats) -> float:
    """Return the distance from the ego to the polyline, along its segments."""
    a, b = points[:-1], points[1:]
    step = b - a
    share = np.clip(-(a * step).sum(axis=1) / np.maximum((step * step).sum(axis=1), 1e-9), 0.0, 1.0)
    return float(np.hypot(*(a + share[:, None] * step).T).min())
