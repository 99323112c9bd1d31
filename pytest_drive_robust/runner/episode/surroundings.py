"""What was around the ego while it drove, and what the agent meant to do: kept for people, decides no number."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from pytest_drive_robust.domain.tracks import Tracks
from pytest_drive_robust.domain.truth import WorldState

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from pytest_drive_robust.domain.agent import Agent, PlannedPath

    Ints = NDArray[np.int32]

__all__ = ["Surroundings"]

_EVERY_TICKS = 4
"""5 Hz: between two samples an actor at 20 m/s moves 4 m, which a straight line follows to the centimetre."""
_PLAN_EVERY_TICKS = 8
_MOST_POINTS = 10
"""Of each kind in a plan; of longer ones every n-th is kept, and the last."""
_RADIUS_M = 120.0
_FARTHEST_M = 1000.0
_PER_M, _PER_RAD, _POINTS_PER_M = 100.0, 1000.0, 10.0


class Surroundings:
    """Collects what becomes `Tracks`. A world or a plan that cannot be noted leaves nothing, and harms no episode."""

    def __init__(self) -> None:
        self._states: list[tuple[Any, Any, float, float]] = []
        self._plans: list[tuple[int, PlannedPath]] = []
        self._next_plan = 0

    def wants(self, tick: int) -> bool:
        """Return True in the ticks whose world is to be seen."""
        return tick % _EVERY_TICKS == 0

    def see(self, tick: int, state: WorldState) -> None:
        """Keep the world at the beginning of `tick`."""
        self._states.append((state.actors.copy(), state.lights.copy(), state.ego.x_m, state.ego.y_m))

    def wants_plan(self, tick: int) -> bool:
        """Return True when the plan behind an answer of `tick` is to be seen."""
        return tick >= self._next_plan

    def see_plan(self, tick: int, agent: Agent) -> None:
        """Keep the agent's plan, where it has one. One that raises is not asked again in this episode."""
        plan: Any = getattr(agent, "plan", None)
        self._next_plan = tick + _PLAN_EVERY_TICKS
        try:
            self._plans.append((tick, plan()))
        except (Exception, SystemExit):  # no `plan` at all is the usual case
            self._next_plan = 1 << 60

    def tracks(self) -> Tracks | None:
        """Return what was seen; None when nothing was, or when the world's tables are no such tables."""
        import numpy as np

        if not self._states:
            return None
        try:
            actors, motion = _tracks_of(self._states)
            lights = np.array([lights for _, lights, _, _ in self._states], np.int32)
            plans, points = _plans_of(self._plans)
            return Tracks(_EVERY_TICKS, actors, motion, lights.reshape(len(self._states), -1), plans, points)
        except (ArithmeticError, AttributeError, IndexError, TypeError, ValueError):
            return None


def _tracks_of(states: list[tuple[Any, Any, float, float]]) -> tuple[Ints, Ints]:
    """Return `Tracks.actors` and `Tracks.motion`: an actor that goes away and comes back has two tracks."""
    import numpy as np

    counts = [len(actors) for actors, _, _, _ in states]
    if not sum(counts):
        return np.zeros((0, 6), np.int32), np.zeros((0, 4), np.int32)
    rows = np.concatenate([actors for actors, _, _, _ in states if len(actors)])
    sample = np.repeat(np.arange(len(states)), counts)
    ego = np.repeat(np.array([(x, y) for _, _, x, y in states]), counts, axis=0)
    near = np.hypot(*(rows[:, [WorldState.X, WorldState.Y]] - ego).T) <= _RADIUS_M
    rows, sample = rows[near], sample[near]
    if not len(rows):
        return np.zeros((0, 6), np.int32), np.zeros((0, 4), np.int32)
    order = np.lexsort((sample, rows[:, WorldState.ID]))
    rows, sample = rows[order], sample[order]
    first = np.ones(len(rows), bool)
    first[1:] = (np.diff(rows[:, WorldState.ID]) != 0) | (np.diff(sample) != 1)
    first[1:] |= np.diff(rows[:, WorldState.KIND]) != 0
    starts = np.flatnonzero(first)
    lengths = np.diff(np.append(starts, len(rows)))
    heads = rows[starts]
    sizes = np.round(heads[:, [WorldState.LENGTH, WorldState.WIDTH]] * _PER_M)
    actors = np.column_stack((heads[:, [WorldState.ID, WorldState.KIND]], sizes, sample[starts], lengths))
    places = np.round(rows[:, [WorldState.X, WorldState.Y]] * _PER_M)
    yaw = rows[:, WorldState.YAW].copy()
    for start, length in zip(starts.tolist(), lengths.tolist(), strict=True):
        yaw[start : start + length] = np.unwrap(yaw[start : start + length])
    motion = np.column_stack((places, np.round(yaw * _PER_RAD), rows[:, WorldState.STATE]))
    return actors.astype(np.int32), motion.astype(np.int32)


def _plans_of(plans: list[tuple[int, PlannedPath]]) -> tuple[Ints, Ints]:
    """Return `Tracks.plans` and `Tracks.points`; a plan with a point that is none is left out."""
    import numpy as np

    heads: list[tuple[int, int, int, int]] = []
    points: list[tuple[float, float]] = []
    for tick, plan in plans:
        parts = [_thinned(part) for part in (plan.path, plan.target_points, plan.speed_points)]
        found = [(float(forward), float(right)) for part in parts for forward, right in part]
        if all(math.hypot(*point) <= _FARTHEST_M for point in found):  # not finite is not near either
            heads.append((tick, len(parts[0]), len(parts[1]), len(parts[2])))
            points += found
    scaled = np.round(np.array(points, np.float64).reshape(-1, 2) * _POINTS_PER_M)
    return np.array(heads, np.int32).reshape(-1, 4), scaled.astype(np.int32)


def _thinned(points: Any) -> list[Any]:
    listed = list(points)
    if len(listed) <= _MOST_POINTS:
        return listed
    step = -(-len(listed) // (_MOST_POINTS - 1))
    return [*listed[:-1:step], listed[-1]]
