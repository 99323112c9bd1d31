"""Find the lane under each row of a route: the sequence of lanes that fits best as a whole."""

from __future__ import annotations

import numpy as np

from pytest_drive_robust.arithmetic import arrays
from pytest_drive_robust.domain.truth import Lane, LaneKind, LaneMap
from pytest_drive_robust.errors import RouteError
from pytest_drive_robust.jit.arrays import Floats, Ints

_BEYOND_EDGE_M = 0.5
_SAME_WAY = 0.5
"""Least cosine between the headings of a row and of its lane."""
_NEXT_COST, _CHANGE_COST, _JUMP_COST = 0.05, 2.0, 50.0
_TURN_COST_M = 3.0
_SAME_COST_M = 0.3


def match_lanes(lane_map: LaneMap, line: Floats) -> Ints:
    """Return the lane index under each row of `line` (n, 3), or -1 where no lane fits.

    A row fits a driving lane when the row lies on the lane (half a metre beside at most) and heads the same way. The
    sequence of lanes with the least total distance is chosen. A lane change counts as 2 m; a jump to a lane that
    neither follows nor lies beside the last lane counts as 50 m. At forks, where several lanes share their first
    metres, the end of the route therefore decides.
    """
    near = [lane for lane in lane_map.lanes if lane.kind is LaneKind.DRIVING and _is_near(lane, line)]
    cost = _costs(near, line)
    fits = np.isfinite(cost).any(axis=1)
    if not fits.all():
        return np.where(fits, 0, -1)
    found = _cheapest(cost, _step_costs(near))
    return np.array([lane.index for lane in near], dtype=np.int64)[found]


def distance_to_lanes(lane_map: LaneMap, x_m: float, y_m: float) -> float:
    """Return the metres from a point to the middle of the nearest driving lane."""
    lanes = [lane.centre for lane in lane_map.lanes if lane.kind is LaneKind.DRIVING]
    return float(min(arrays.hypot(centre[:, 0] - x_m, centre[:, 1] - y_m).min() for centre in lanes))


def nearest_way(lane_map: LaneMap, start: tuple[float, float], end: tuple[float, float]) -> tuple[int, ...]:
    """Return the sequence of connected driving lanes that comes nearest to `start` and then to `end`.

    Raises `RouteError` when no lane leads from `start` to `end`.
    """
    driving = {lane.index: lane for lane in lane_map.lanes if lane.kind is LaneKind.DRIVING}
    from_m, at_from = _nearest(driving, start)
    to_m, at_to = _nearest(driving, end)
    best: tuple[float, tuple[int, ...]] | None = None
    for first in driving:
        ways: dict[int, tuple[int, ...]] = {first: (first,)}
        waiting = [first]
        while waiting:
            here = waiting.pop(0)
            backwards = here == first and at_to[here] < at_from[here]
            cost = from_m[first] + to_m[here]
            if not backwards and (best is None or cost < best[0] - _SAME_COST_M):
                best = cost, ways[here]
            for onward in driving[here].successors:
                if onward in driving and onward not in ways:
                    ways[onward] = (*ways[here], onward)
                    waiting.append(onward)
    if best is None:
        raise RouteError(f"town {lane_map.name}: no lane leads from {start} to {end}")
    return best[1]


def _nearest(lanes: dict[int, Lane], point: tuple[float, float]) -> tuple[dict[int, float], dict[int, int]]:
    """Return by lane the distance from a point to the lane [m], and the nearest row of the lane's centre line."""
    away = {k: arrays.hypot(lane.centre[:, 0] - point[0], lane.centre[:, 1] - point[1]) for k, lane in lanes.items()}
    return {k: float(d.min()) for k, d in away.items()}, {k: int(d.argmin()) for k, d in away.items()}


def _cheapest(cost: Floats, steps: Floats) -> Ints:
    """Return a column for each row of `cost` (n, k): the least sum of costs and of `steps` (k, k) between columns."""
    total = cost[0]
    came_from = np.zeros(cost.shape, dtype=np.int64)
    for row in range(1, len(cost)):
        through = total[:, None] + steps
        came_from[row] = np.argmin(through, axis=0)
        total = np.min(through, axis=0) + cost[row]
    found = np.empty(len(cost), dtype=np.int64)
    found[-1] = int(np.argmin(total))
    for row in range(len(cost) - 1, 0, -1):
        found[row - 1] = came_from[row, found[row]]
    return found


def lane_change_side(lanes: tuple[Lane, ...], before: int, after: int) -> int:
    """Return 1 when lane `after` lies to the right of lane `before` or of its successors, -1 to the left, else 0."""
    for way, side in ((-1, "left"), (1, "right")):
        beside = _along(lanes[before], side)
        if beside >= 0 and (beside == after or after in lanes[beside].successors):
            return way
        if any(_along(lanes[onward], side) == after for onward in lanes[before].successors):
            return way
    return 0


def _along(lane: Lane, side: str) -> int:
    """Return the index of the neighbour on `side` that leads the same way, or -1."""
    index, same_way = lane.beside(side)
    return index if same_way else -1


def _is_near(lane: Lane, line: Floats) -> bool:
    """Return whether the boxes around a lane and a line touch."""
    reach = lane.width_m / 2.0 + _BEYOND_EDGE_M
    low = np.maximum(line[:, :2].min(axis=0), lane.centre[:, :2].min(axis=0) - reach)
    high = np.minimum(line[:, :2].max(axis=0), lane.centre[:, :2].max(axis=0) + reach)
    return bool((low <= high).all())


def _costs(driving: list[Lane], line: Floats) -> Floats:
    """Return the cost of every row on every lane, (n, lanes); infinite where the lane does not fit."""
    cost = np.full((len(line), len(driving)), np.inf)
    for k, lane in enumerate(driving):
        away = arrays.hypot(line[:, :1] - lane.centre[:, 0], line[:, 1:2] - lane.centre[:, 1])
        nearest = away.argmin(axis=1)
        distance = away[np.arange(len(line)), nearest]
        along = arrays.cos(line[:, 2] - lane.centre[nearest, 2])
        fits = (distance <= lane.width_m / 2.0 + _BEYOND_EDGE_M) & (along >= _SAME_WAY)
        cost[fits, k] = (distance + _TURN_COST_M * (1.0 - along))[fits]
    return cost


def _step_costs(driving: list[Lane]) -> Floats:
    number = {lane.index: k for k, lane in enumerate(driving)}
    steps = np.full((len(driving), len(driving)), _JUMP_COST)
    for k, lane in enumerate(driving):
        for side in (_along(lane, "left"), _along(lane, "right")):
            if side in number:
                steps[k, number[side]] = _CHANGE_COST
                for onward in driving[number[side]].successors:
                    if onward in number:
                        steps[k, number[onward]] = min(steps[k, number[onward]], _CHANGE_COST)
    for k, lane in enumerate(driving):
        for onward in lane.successors:
            if onward in number:
                steps[k, number[onward]] = _NEXT_COST
    np.fill_diagonal(steps, 0.0)
    return steps
