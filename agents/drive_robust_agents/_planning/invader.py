"""Keep to the right of oncoming actors that reach into the ego's lane (invaders)."""

from __future__ import annotations

import numpy as np

from drive_robust_agents._planning import columns as box
from drive_robust_agents._planning.projection import nearest_row
from drive_robust_agents._planning.situation import Situation
from pytest_drive_robust.jit.arrays import Floats1, Floats2
from pytest_drive_robust.jit.kernels import entry

__all__ = ["InvaderAvoidance"]

_LOOK_M, _BEHIND_M = 90, 3.0
_TURNING_M = 12.0
"""Distance from a junction within which a turning actor is no invader, because its turn crosses lanes."""
_REACHES_M, _BESIDE_M = 0.05, -0.5
_GAP_M, _HOLD_TICKS = 0.5, 600
_EDGE_M = 0.3
"""Distance beyond the right edge of its lane to which the ego moves to avoid an invader."""


class InvaderAvoidance:
    """Moves the ego to the right while an invader reaches into its lane, and for `_HOLD_TICKS` afterwards."""

    def __init__(self) -> None:
        self._right_m, self._ticks_left = 0.0, 0

    def shift_m(self, now: Situation) -> float:
        """Return the metres to move right in this tick; call once a tick."""
        scene = now.scene
        half_lane_m = 0.5 * scene.lane_at(now.row).width_m
        edge = _edge(
            scene.route, scene.cosines, scene.sines, scene.junctions, scene.given, now.traffic.boxes, now.row,
            half_lane_m,
        )  # fmt: skip
        if edge > -np.inf:
            need_m = edge + scene.half_width_m + _GAP_M
            self._right_m = max(self._right_m, min(need_m, half_lane_m - scene.half_width_m + _EDGE_M))
            self._ticks_left = _HOLD_TICKS
        self._ticks_left -= now.ticks
        return self._right_m if self._ticks_left > 0 else 0.0


@entry
def _edge(
    route: Floats2, cosines: Floats1, sines: Floats1, junctions: Floats2, given: int, boxes: Floats2, row: float,
    half_lane_m: float,
) -> float:  # fmt: skip
    """Return how far to the right of the route the invaders ahead reach at most [m], minus infinity without one.

    `boxes` are `Traffic.boxes`; the ego is at `row`, and its lane is twice `half_lane_m` wide.
    """
    farthest = -np.inf
    here = int(min(max(row, 0.0), len(route) - 1.0))
    for i in range(len(boxes)):
        if boxes[i, box.SPEED] <= 1.0:
            continue
        k = nearest_row(route, here - 5, here + _LOOK_M, boxes[i, box.X], boxes[i, box.Y])
        dx, dy = boxes[i, box.X] - route[k, 0], boxes[i, box.Y] - route[k, 1]
        at, right = k + dx * cosines[k] + dy * sines[k], dy * cosines[k] - dx * sines[k]
        reach = right + 0.5 * boxes[i, box.WIDTH]
        invades = right < _BESIDE_M and reach > _REACHES_M - half_lane_m and reach > farthest
        if not invades or at <= row - _BEHIND_M or at >= min(here + _LOOK_M, given) - 2:
            continue
        k = int(min(max(at, 0.0), len(route) - 1.0))
        if cosines[k] * boxes[i, box.COS] + sines[k] * boxes[i, box.SIN] >= -0.8:
            continue
        turns = False
        for b in range(len(junctions)):
            turns = turns or junctions[b, 0] - _TURNING_M <= at <= junctions[b, 1] + _TURNING_M
        if not turns:
            farthest = reach
    return farthest
