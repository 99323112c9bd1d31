"""Which lane lies under each row of a route: the row of lanes that fits best as a whole."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pytest_drive_robust.domain.truth import Lane, LaneKind, LaneMap

__all__ = ["lane_change_side", "match_lanes"]

Floats = NDArray[np.float64]
_BEYOND_EDGE_M = 0.5
_SAME_WAY = 0.5
"""Least cosine between the headings of a row and of its lane."""
_NEXT_COST, _CHANGE_COST, _JUMP_COST = 0.05, 2.0, 50.0
_TURN_COST_M = 3.0


def match_lanes(lane_map: LaneMap, line: Floats) -> tuple[NDArray[np.int64], Floats]:
    """(lane index under each row or -1, distance of each row from the nearest lane), both (n,).

    A row fits a driving lane when it lies on it (half a metre beside it at most) and heads its way. Of the rows of
    lanes that fit, the one with the least total distance is taken, where going on to a lane that neither follows nor
    lies beside the last one counts as 50 m and a change of lane as 2 m: at forks, where several lanes share their first
    metres, the end of the route decides. Without a fitting lane the row, and then every row, has -1.
    """
    driving = [lane for lane in lane_map.lanes if lane.kind is LaneKind.DRIVING]
    away, cost = _costs(driving, line)
    nearest = away.min(axis=1)
    if not np.isfinite(cost).any(axis=1).all():
        fits = np.isfinite(cost).any(axis=1)
        return np.where(fits, 0, -1), nearest
    steps = _step_costs(driving)
    total = cost[0]
    came_from = np.zeros(cost.shape, dtype=np.int64)
    for row in range(1, len(line)):
        through = total[:, None] + steps
        came_from[row] = np.argmin(through, axis=0)
        total = np.min(through, axis=0) + cost[row]
    found = np.empty(len(line), dtype=np.int64)
    found[-1] = int(np.argmin(total))
    for row in range(len(line) - 1, 0, -1):
        found[row - 1] = came_from[row, found[row]]
    return np.array([lane.index for lane in driving], dtype=np.int64)[found], nearest


def lane_change_side(lanes: tuple[Lane, ...], before: int, after: int) -> int:
    """1 when lane `after` lies to the right of lane `before` (or of what follows it), -1 to the left, else 0."""
    for side, neighbour in ((-1, _left), (1, _right)):
        beside = neighbour(lanes[before])
        if beside >= 0 and (beside == after or after in lanes[beside].successors):
            return side
        if any(neighbour(lanes[onward]) == after for onward in lanes[before].successors):
            return side
    return 0


def _left(lane: Lane) -> int:
    return lane.left if lane.left_same_way else -1


def _right(lane: Lane) -> int:
    return lane.right if lane.right_same_way else -1


def _costs(driving: list[Lane], line: Floats) -> tuple[Floats, Floats]:
    """(distance, cost) of every row to every lane, (n, lanes) each; infinite cost where the lane does not fit."""
    points = np.concatenate([lane.centre for lane in driving])
    starts = np.concatenate([[0], np.cumsum([len(lane.centre) for lane in driving])[:-1]])
    away = np.hypot(line[:, :1] - points[:, 0], line[:, 1:2] - points[:, 1])
    heads = np.column_stack([np.cos(line[:, 2]), np.sin(line[:, 2])])
    along = heads @ np.stack([np.cos(points[:, 2]), np.sin(points[:, 2])])
    reach = np.repeat([lane.width_m / 2.0 + _BEYOND_EDGE_M for lane in driving], [len(k.centre) for k in driving])
    fits = (away <= reach) & (along >= _SAME_WAY)
    cost = np.where(fits, away + _TURN_COST_M * (1.0 - along), np.inf)
    return np.minimum.reduceat(away, starts, axis=1), np.minimum.reduceat(cost, starts, axis=1)


def _step_costs(driving: list[Lane]) -> Floats:
    number = {lane.index: k for k, lane in enumerate(driving)}
    steps = np.full((len(driving), len(driving)), _JUMP_COST)
    for k, lane in enumerate(driving):
        for side in (_left(lane), _right(lane)):
            if side in number:
                steps[k, number[side]] = _CHANGE_COST
                for onward in driving[number[side]].successors:
                    steps[k, number[onward]] = np.minimum(steps[k, number[onward]], _CHANGE_COST)
    for k, lane in enumerate(driving):
        for onward in lane.successors:
            steps[k, number[onward]] = _NEXT_COST
    np.fill_diagonal(steps, 0.0)
    return steps
