"""UniAD's last step: move the plan off the cells that will be occupied.

The published cost (Hu et al. 2023, section 3.4; Bench2DriveZoo `planning_head_plugin/collision_optimization.py`) is
the squared distance of each waypoint to its original place, plus a bell of 5 / (2.507 s) exp(-d^2 / 2 s^2) for each
occupied cell within 5 m, s = 1 m. Published: CasADi and IPOPT. No term connects waypoints, so each waypoint is a small
problem of two unknowns; damped Newton steps solve it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pytest_drive_robust.arithmetic import arrays, scalars
from pytest_drive_robust.jit.arrays import Floats

__all__ = ["clear_of"]

_SPREAD_M, _REACH_M = 1.0, 5.0
_HEIGHT = 5.0 / (2.507 * _SPREAD_M)
_STEPS, _HALVINGS = 10, 6
_LONGEST_M = 0.5
_LEAST_CURVATURE = 0.5
_STILL_M = 1e-3


def clear_of(
    plan: NDArray[np.floating], occupied: NDArray[np.floating], centres: NDArray[np.floating], *, from_share: float
) -> Floats:
    """Return the plan (T, 2) in metres, moved to lower cost; a plan without filled cells nearby stays unchanged.

    `occupied` (K, rows, columns) is the probability that cells with `centres` (rows, columns, 2) [m] are filled now and
    every 0.5 s. Waypoint t (from 1) is kept off map t, or off the last map. Cells with at least `from_share` are
    filled.
    """
    moved = np.array(plan, dtype=np.float64)
    for t, start in enumerate(moved.copy()):
        filled = centres[occupied[min(t + 1, len(occupied) - 1)] >= from_share].astype(np.float64)
        near = filled[((filled - start) ** 2).sum(axis=1) < _REACH_M**2]
        if len(near):
            moved[t] = _settled(start, near)
    return moved


def _settled(start: Floats, cells: Floats) -> Floats:
    """Return the place of least cost that the steps reach from a waypoint among filled cells (n, 2)."""
    point, cost = start, _cost(start, start, cells)
    for _ in range(_STEPS):
        step = _newton(point, start, cells)
        for _ in range(_HALVINGS):
            there = point + step
            lower = _cost(there, start, cells)
            if lower < cost:
                point, cost = there, lower
                break
            step = 0.5 * step
        else:
            break
        if scalars.hypot(step[0], step[1]) < _STILL_M:
            break
    return point


def _cost(point: Floats, start: Floats, cells: Floats) -> float:
    bells = arrays.exp(((cells - point) ** 2).sum(axis=1) * (-0.5 / _SPREAD_M**2))
    return float(((point - start) ** 2).sum() + _HEIGHT * bells.sum())


def _newton(point: Floats, start: Floats, cells: Floats) -> Floats:
    """Return the damped Newton step, at most 0.5 m; negative curvatures are lifted, so that the step leads downhill."""
    away = (point - cells) / _SPREAD_M**2
    bells = _HEIGHT * arrays.exp((away**2).sum(axis=1) * (-0.5 * _SPREAD_M**2))
    slope = 2.0 * (point - start) - (bells[:, None] * away).sum(axis=0)
    curve = (2.0 - bells.sum() / _SPREAD_M**2) * np.eye(2) + (bells[:, None] * away).T @ away
    values, axes = np.linalg.eigh(curve)
    step: Floats = -axes @ ((axes.T @ slope) / np.maximum(np.abs(values), _LEAST_CURVATURE))
    length = scalars.hypot(step[0], step[1])
    return step * min(1.0, _LONGEST_M / length) if length > 0.0 else step
