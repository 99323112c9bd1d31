"""Everybody else, tick by tick: who they are, how they accelerate, how long they have been standing, where they go."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from drive_robust_agents._planning.control import Floats
from drive_robust_agents._planning.static_scene import LaneGraph
from drive_robust_agents._planning.tracks import STEP_S, tracks
from pytest_drive_robust.domain.truth import ActorKind, WorldState

__all__ = ["HORIZON_S", "Traffic"]

Ints = NDArray[np.int64]

HORIZON_S = 12.0
_DT_S = 0.05
_BOX = [WorldState.X, WorldState.Y, WorldState.YAW, WorldState.SPEED, WorldState.LENGTH, WorldState.WIDTH]
_RANGE_M = 160.0
_HARD_MPS2 = 1.5


class Traffic:
    """The other actors of this moment, one row each in every array.

    `boxes` (k, 7) is x, y, yaw, speed, length, width, acceleration; `kinds`, `ids` (k,); `stood_s` (k,) seconds without
    moving; `forecast` (k, steps, 4) and `sizes` (k, 2) are what `forecast.rollouts` wants.
    """

    def __init__(self) -> None:
        self._speeds = np.full(0, np.nan)
        self._stood = np.zeros(0)
        self.boxes: Floats = np.zeros((0, 7))
        self.kinds: Ints = np.zeros(0, dtype=np.int64)
        self.ids: Ints = np.zeros(0, dtype=np.int64)
        self.stood_s: Floats = np.zeros(0)
        self.sizes: Floats = np.zeros((0, 2))
        self.forecast: Floats = np.zeros((0, 2, 4))

    def update(self, world: WorldState, graph: LaneGraph) -> None:
        """See the actors of a new tick."""
        rows = world.actors
        near = (
            np.abs(rows[:, WorldState.X] - world.ego.x_m) + np.abs(rows[:, WorldState.Y] - world.ego.y_m)
            < 1.4 * _RANGE_M
        )
        rows = rows[near & (rows[:, WorldState.KIND] != ActorKind.DIRT)]
        self.kinds = rows[:, WorldState.KIND].astype(np.int64)
        self.ids = rows[:, WorldState.ID].astype(np.int64)
        speed = rows[:, WorldState.SPEED]
        self._remember(speed)
        self.boxes = np.empty((len(rows), 7))
        self.boxes[:, :6] = rows[:, _BOX]
        self.boxes[:, 6] = np.where(self.kinds < ActorKind.BICYCLE, self._accelerations, 0.0)
        self._doubt()
        self.sizes = np.ascontiguousarray(self.boxes[:, 4:6])
        follows = ((self.kinds <= ActorKind.BICYCLE) & (self.boxes[:, 3] > 0.05)).astype(np.int64)
        self.forecast, under = tracks(
            self.boxes, follows, graph.points, graph.owner, graph.first, graph.after, round(HORIZON_S / STEP_S)
        )
        graph.learn(under)

    def _doubt(self) -> None:
        """List those who accelerate hard twice, the second time at constant speed: they may also stop doing so."""
        hard = np.abs(self.boxes[:, 6]) > _HARD_MPS2
        if hard.any():
            steady = self.boxes[hard]
            steady[:, 6] = 0.0
            self.boxes = np.concatenate([self.boxes, steady])
            self.kinds = np.concatenate([self.kinds, self.kinds[hard]])
            self.ids = np.concatenate([self.ids, self.ids[hard]])
            self.stood_s = np.concatenate([self.stood_s, self.stood_s[hard]])

    def _remember(self, speed: Floats) -> None:
        most = int(self.ids.max(initial=-1)) + 1
        if most > len(self._speeds):
            more = most - len(self._speeds)
            self._speeds = np.concatenate([self._speeds, np.full(more, np.nan)])
            self._stood = np.concatenate([self._stood, np.zeros(more)])
        gained = np.nan_to_num((speed - self._speeds[self.ids]) / _DT_S)
        self._accelerations = np.where(np.abs(gained) > 0.3, np.clip(gained, -8.0, 8.0), 0.0)
        stood = np.where(speed < 0.1, self._stood[self.ids] + _DT_S, 0.0)
        self._speeds[:] = np.nan
        self._speeds[self.ids] = speed
        self._stood[:] = 0.0
        self._stood[self.ids] = stood
        self.stood_s = stood
