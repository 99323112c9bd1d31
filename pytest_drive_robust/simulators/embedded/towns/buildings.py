"""Houses beside the roads: never on a lane, close enough to hide who comes round the corner."""

from __future__ import annotations

import hashlib

import numpy as np
from numpy.typing import NDArray

from pytest_drive_robust.arithmetic import arrays, scalars
from pytest_drive_robust.arithmetic.random_numbers import RandomNumbers
from pytest_drive_robust.domain.truth import Lane, LaneKind
from pytest_drive_robust.simulators.embedded.geometry import place
from pytest_drive_robust.simulators.embedded.towns.town import Town

__all__ = ["draw_buildings"]

Floats = NDArray[np.float64]
_CLEAR_M = 0.8
"""Least distance between a wall and the edge of any lane in a city; in the country it is the least gap."""
_STEP_M = 22
_NEAR_M = 50.0
"""More than half the diagonal of the largest house and the widest lane and gap together."""


def draw_buildings(town: Town, lanes: tuple[Lane, ...]) -> Floats:
    """Return (b, 6): x, y, yaw, length, width, height of every house."""
    key = hashlib.blake2b(f"{town.name}\x1fhouses".encode(), digest_size=16).digest()
    rng = RandomNumbers(key)
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
            near = _is_near(row, points)
            if bool((_outside(row, points[near]) > clear[near]).all()) and _apart(row, rows):
                rows.append(row)
    return np.array(rows, dtype=float).reshape(-1, 6)


def _is_near(row: list[float], points: Floats) -> NDArray[np.bool_]:
    """Return points that may be too close to a house: the exact distance is worked out for these only."""
    return np.asarray(np.abs(points - row[:2]).max(axis=1) < _NEAR_M)


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
