"""Convert a drawn town to lanes, sampled every metre, with neighbours, successors, stop lines, and to houses."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from pytest_drive_robust.arithmetic import arrays, scalars
from pytest_drive_robust.arithmetic.random_numbers import RandomNumbers
from pytest_drive_robust.domain.truth import Lane, LaneKind, StopLine
from pytest_drive_robust.jit.arrays import Floats
from pytest_drive_robust.simulators.embedded.geometry import arc_lengths, place
from pytest_drive_robust.simulators.embedded.towns.town import JunctionControl, Town

_JOIN_M = 0.5
"""Greatest distance from the end of a lane to the start of its successor."""
_STOP_BEFORE_END_M = 5.0
"""Distance of the stop line before the junction box, which keeps the crosswalk free."""

_Side = tuple[int, bool]
_NOBODY: _Side = (-1, False)
_CLEAR_M = 0.8
"""Least distance between a wall and the edge of any lane in a city; in the country `building_gap_m` holds instead."""
_STEP_M = 22
_NEAR_M = 50.0
"""More than half the diagonal of the largest house and the widest lane and gap together.

Only for points nearer than this the exact distance to a house is computed.
"""


def draw_lanes(town: Town) -> tuple[Lane, ...]:
    """Return every lane of the town, numbered in the order in which they were drawn."""
    left, right = _neighbours(town)
    successors = _successors(town)
    return tuple(
        Lane(
            index=k,
            kind=lane.kind,
            centre=lane.centre,
            width_m=float(lane.width_m),
            speed_limit_mps=float(lane.speed_mps),
            junction=lane.junction >= 0,
            left=left.get(k, _NOBODY)[0],
            right=right.get(k, _NOBODY)[0],
            left_same_way=left.get(k, _NOBODY)[1],
            right_same_way=right.get(k, _NOBODY)[1],
            left_line=lane.lines[0],
            right_line=lane.lines[1],
            successors=successors[k],
        )
        for k, lane in enumerate(town.lanes)
    )


def _neighbours(town: Town) -> tuple[dict[int, _Side], dict[int, _Side]]:
    """Return the left and the right neighbour by lane number, each as (lane number, leads the same way)."""
    left: dict[int, _Side] = {}
    right: dict[int, _Side] = {}
    for strip in town.slices:
        for (west, west_along), (east, east_along) in pairwise(strip):
            same_way = west_along == east_along
            (right if west_along else left)[west] = (east, same_way)
            (left if east_along else right)[east] = (west, same_way)
    return left, right


def _successors(town: Town) -> list[tuple[int, ...]]:
    """Return the lanes of the same kind that begin where each lane ends, heading the same way."""
    kinds = np.array([int(lane.kind) for lane in town.lanes])
    starts, ends = (np.array([lane.centre[row] for lane in town.lanes]) for row in (0, -1))
    meets = arrays.hypot(*(ends[:, None, :2] - starts[None, :, :2]).transpose(2, 0, 1)) < _JOIN_M
    meets &= arrays.cos(ends[:, None, 2] - starts[None, :, 2]) > 0.9
    meets &= kinds[:, None] == kinds[None, :]
    np.fill_diagonal(meets, False)
    return [tuple(int(other) for other in np.flatnonzero(row)) for row in meets]


def stop_lines(town: Town, lanes: tuple[Lane, ...]) -> tuple[StopLine, ...]:
    """Return a stop line for each controlled lane, `_STOP_BEFORE_END_M` before its end.

    A light stands at the far corner of the junction, where a driver at the line can see it; a sign stands at the line.
    Both stand to the right of the outermost lane.
    """
    return tuple(_stop_line(k, lanes[control.lane], control, lanes) for k, control in enumerate(town.controls))


def _stop_line(k: int, lane: Lane, control: JunctionControl, lanes: tuple[Lane, ...]) -> StopLine:
    length = arc_lengths(lane.centre)[-1]
    x, y, heading = place(lane.centre, length - _STOP_BEFORE_END_M)
    edge = lane.width_m / 2.0 + _to_kerb_m(lanes, lane)
    is_light = control.what == "light"
    pole = place(lane.centre, length + control.far_m, edge + control.aside_m) if is_light else place(
        lane.centre, length - _STOP_BEFORE_END_M + 0.5, edge + 1.0
    )  # fmt: skip
    return StopLine(k, lane.index, x, y, heading, lane.width_m, is_light, pole[0], pole[1])


def _to_kerb_m(lanes: tuple[Lane, ...], lane: Lane) -> float:
    """Return the total width in metres of the lanes to the right of `lane`, up to the sidewalk."""
    total = 0.0
    while lane.right >= 0 and lane.right_same_way and lanes[lane.right].kind is not LaneKind.SIDEWALK:
        lane = lanes[lane.right]
        total += lane.width_m
    return total


def draw_buildings(town: Town, lanes: tuple[Lane, ...]) -> Floats:
    """Return (b, 6): x, y, yaw, length, width, height of every house."""
    rng = RandomNumbers.of(town.name, "houses")
    points = np.concatenate([lane.centre[:, :2] for lane in lanes])
    radii = np.concatenate([np.full(len(lane.centre), lane.width_m / 2.0) for lane in lanes])
    walks = [lane for lane in lanes if lane.kind is LaneKind.SIDEWALK]
    fronts = walks or [lane for lane in lanes if lane.right < 0 and not lane.junction]
    clear = radii + (_CLEAR_M if walks else town.building_gap_m[0])
    rows: list[list[float]] = []
    for lane in fronts:
        for start in range(5, len(lane.centre) - 12, _STEP_M):
            length, depth, height = rng.uniform(12.0, 19.0), rng.uniform(8.0, 14.0), rng.uniform(6.0, 18.0)
            gap = rng.uniform(*town.building_gap_m) + 0.05
            pose = place(lane.centre, float(start + 8), gap + depth / 2.0 + lane.width_m / 2.0)
            row = [*pose, float(length), float(depth), float(height)]
            near = np.abs(points - row[:2]).max(axis=1) < _NEAR_M
            if bool((_outside(row, points[near]) > clear[near]).all()) and _apart(row, rows):
                rows.append(row)
    return np.array(rows, dtype=float).reshape(-1, 6)


def _outside(row: list[float], points: Floats) -> Floats:
    """Return the distance of each point from a house, 0 inside."""
    dx, dy = points[:, 0] - row[0], points[:, 1] - row[1]
    cos, sin = scalars.cos(row[2]), scalars.sin(row[2])
    along = np.maximum(np.abs(dx * cos + dy * sin) - row[3] / 2.0, 0.0)
    across = np.maximum(np.abs(dy * cos - dx * sin) - row[4] / 2.0, 0.0)
    return arrays.hypot(along, across)


def _apart(row: list[float], rows: list[list[float]]) -> bool:
    reach = scalars.hypot(row[3], row[4]) / 2.0
    return all(
        scalars.hypot(row[0] - other[0], row[1] - other[1]) > reach + scalars.hypot(other[3], other[4]) / 2.0 - 4.0
        for other in rows
    )
