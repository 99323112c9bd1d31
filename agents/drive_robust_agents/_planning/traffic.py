"""Track all other actors from tick to tick: kind, acceleration, standing time, predicted track."""

from __future__ import annotations

import numpy as np

from drive_robust_agents._planning import columns as box
from drive_robust_agents._planning.static_scene import LaneGraph
from drive_robust_agents._planning.tracks import STEP_S, tracks
from drive_robust_agents._vehicle.mkz import TICK_S
from pytest_drive_robust.arithmetic.compiled import cos, sin
from pytest_drive_robust.domain.truth import ActorKind, WorldState
from pytest_drive_robust.jit.arrays import Floats, Floats2, Ints
from pytest_drive_robust.jit.kernels import entry

__all__ = ["Traffic"]

_STEPS = round(12.0 / STEP_S)
_RANGE_M = 160.0
_HARD_MPS2 = 1.5
_LEAST_MPS2, _MOST_MPS2 = 0.3, 8.0
_BICYCLE, _DIRT = int(ActorKind.BICYCLE), int(ActorKind.DIRT)
_ID, _KIND, _X, _Y, _YAW = WorldState.ID, WorldState.KIND, WorldState.X, WorldState.Y, WorldState.YAW
_SPEED, _LENGTH, _WIDTH = WorldState.SPEED, WorldState.LENGTH, WorldState.WIDTH


class Traffic:
    """The other actors of this moment, one row each in every array.

    `boxes` (k, 9) has the columns of `columns`; `kinds` (k,); `stood_s` (k,) seconds without moving;
    `forecast` (k, steps, 6) comes from `tracks.tracks`. An actor that accelerates hard has a second row at constant
    speed, because it may stop accelerating.
    """

    def __init__(self) -> None:
        self._memory: Floats = np.zeros((0, 2))
        self.boxes: Floats = np.zeros((0, box.COLUMNS))
        self.kinds: Ints = np.zeros(0, dtype=np.int64)
        self.stood_s: Floats = np.zeros(0)
        self.forecast: Floats = np.zeros((0, 2, 6))

    def update(self, world: WorldState, graph: LaneGraph, elapsed_s: float = TICK_S) -> None:
        """Read the actors of a new moment, `elapsed_s` after the last update."""
        actors = np.array(world.actors, np.float64)  # kernels are compiled anew for arrays that are read-only
        looked = _look(actors, world.ego.x_m, world.ego.y_m, self._memory, elapsed_s)
        self._memory, self.boxes, self.stood_s, about = looked
        self.kinds, follows = about
        self.forecast = tracks(
            self.boxes, follows, graph.points, graph.owner, graph.first, graph.after, graph.entries, graph.feeders,
            _STEPS,
        )  # fmt: skip


@entry
def _look(
    actors: Floats2, x_m: float, y_m: float, memory: Floats2, elapsed_s: float
) -> tuple[Floats, Floats, Floats, Ints]:
    """Return (memory for the next look, boxes, seconds without moving, (2, k) of kind, follows a lane).

    `memory` (n, 2) is speed (NaN: not seen) and seconds without moving at the last look, by the actor's id;
    `elapsed_s` is how long ago that was.
    """
    most = -1
    for i in range(len(actors)):
        most = max(most, int(actors[i, _ID]))
    now = np.empty((max(most + 1, len(memory)), 2))
    for i in range(len(now)):
        now[i, 0], now[i, 1] = np.nan, 0.0
    boxes, stood_s = np.empty((2 * len(actors), box.COLUMNS)), np.empty(2 * len(actors))
    about = np.empty((2, 2 * len(actors)), dtype=np.int64)
    count = 0
    for doubted in range(2):
        for i in range(len(actors)):
            kind, number = int(actors[i, _KIND]), int(actors[i, _ID])
            far = abs(actors[i, _X] - x_m) + abs(actors[i, _Y] - y_m) >= 1.4 * _RANGE_M
            if far or kind == _DIRT:
                continue
            speed, gained, stood = actors[i, _SPEED], 0.0, 0.0
            if number < len(memory) and memory[number, 0] == memory[number, 0]:
                gained = (speed - memory[number, 0]) / elapsed_s
            gained = min(max(gained, -_MOST_MPS2), _MOST_MPS2) if abs(gained) > _LEAST_MPS2 else 0.0
            if kind >= _BICYCLE:
                gained = 0.0
            if doubted == 1:
                if abs(gained) <= _HARD_MPS2:
                    continue
                gained = 0.0
            if speed < 0.1:
                stood = elapsed_s + (memory[number, 1] if number < len(memory) else 0.0)
            now[number, 0], now[number, 1] = speed, stood
            row = boxes[count]
            row[box.X], row[box.Y], row[box.YAW] = actors[i, _X], actors[i, _Y], actors[i, _YAW]
            row[box.SPEED], row[box.LENGTH], row[box.WIDTH] = speed, actors[i, _LENGTH], actors[i, _WIDTH]
            row[box.ACCEL], row[box.COS], row[box.SIN] = gained, cos(actors[i, _YAW]), sin(actors[i, _YAW])
            stood_s[count] = stood
            about[0, count], about[1, count] = kind, 1 if kind <= _BICYCLE and speed > 0.05 else 0
            count += 1
    return now, boxes[:count], stood_s[:count], about[:, :count]
