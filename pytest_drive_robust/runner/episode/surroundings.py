"""Records the actors around the ego and the agent's plans, for films and pages; no number depends on this record."""

from __future__ import annotations

import math
from contextlib import suppress
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pytest_drive_robust.domain.agent import Agent, PlannedPath
from pytest_drive_robust.domain.result import Tracks, read_only
from pytest_drive_robust.domain.truth import WorldState
from pytest_drive_robust.errors import AgentError
from pytest_drive_robust.runner.episode.contract import agent_plan

Ints = NDArray[np.int32]

EVERY_TICKS = 4
"""Ticks between samples (5 Hz): an actor at 20 m/s moves 4 m between two, which a line follows to the centimetre."""
_PLAN_EVERY_TICKS = 8
_MOST_POINTS = 10
"""Most points of each kind in a plan; of a longer plan every n-th point and the last one are kept."""
_RADIUS_M = 120.0
_FARTHEST_M = 1000.0
_PER_M, _PER_RAD, _POINTS_PER_M = 100.0, 1000.0, 10.0


class Surroundings:
    """Collects samples for `Tracks`. A world or a plan that cannot be recorded leaves no record and breaks no episode.

    `next_plan` is the first tick in which the agent's next plan is to be recorded.
    """

    def __init__(self) -> None:
        self._rows: Any = None
        self._used = 0
        self._strange = False
        self._egos: list[tuple[int, float, float]] = []
        self._lights: list[Any] = []
        self._plans: list[tuple[int, int, int, int]] = []  # the rows of `Tracks.plans`
        self._points: list[tuple[float, float]] = []
        self.next_plan = 0

    def see(self, state: WorldState) -> None:
        """Record the world at the beginning of a tick. Called in every multiple of `EVERY_TICKS`."""
        try:
            self._note(state)
        except Exception:  # the table of actors is missing or has another width than before
            self._strange = True

    def _note(self, state: WorldState) -> None:
        actors, ego = state.actors, state.ego
        used, ends = self._used, self._used + len(actors)
        if self._rows is None or ends > len(self._rows):
            self._grow(actors, ends)
        self._rows[used:ends] = actors
        self._used = ends
        self._egos.append((len(actors), ego.x_m, ego.y_m))
        self._lights.append(state.lights.copy())

    def _grow(self, actors: Any, ends: int) -> None:
        """Enlarge the table to twice the needed rows: one table is read faster than many small ones."""
        rows = np.empty((max(1024, 2 * ends), *actors.shape[1:]))
        rows[: self._used] = self._rows[: self._used] if self._used else 0.0
        self._rows = rows

    def see_plan(self, tick: int, agent: Agent) -> None:
        """Record the agent's plan, if any. An agent whose `plan` raises is not asked again in this episode."""
        self.next_plan = tick + _PLAN_EVERY_TICKS
        try:
            plan = agent_plan(agent)
        except AgentError:  # no `plan` at all is the usual case
            self.next_plan = 1 << 60
            return
        with suppress(Exception):  # an agent's `plan` may return anything
            self._note_plan(tick, plan)

    def _note_plan(self, tick: int, plan: PlannedPath) -> None:
        """Copy the points, because the agent may reuse their memory; skip a plan with a point not finite or too far."""
        parts = [_thinned(part) for part in (plan.path, plan.target_points, plan.speed_points)]
        found = [(float(forward), float(right)) for part in parts for forward, right in part]
        if all(math.hypot(*point) <= _FARTHEST_M for point in found):  # False for NaN, too
            self._plans.append((tick, len(parts[0]), len(parts[1]), len(parts[2])))
            self._points += found

    def tracks(self) -> Tracks | None:
        """Return the recorded tracks; None when nothing was recorded, or when the world's tables are malformed."""
        if not self._egos or self._strange:
            return None
        try:
            actors, motion = _tracks_of(self._rows[: self._used], self._egos)
            lights = np.array(self._lights, np.int32).reshape(len(self._egos), -1)
            plans = np.array(self._plans, np.int32).reshape(-1, 4)
            points = np.round(np.array(self._points, np.float64).reshape(-1, 2) * _POINTS_PER_M).astype(np.int32)
            return Tracks(EVERY_TICKS, *map(read_only, (actors, motion, lights, plans, points)))
        except (ArithmeticError, AttributeError, IndexError, TypeError, ValueError):
            return None


def _tracks_of(rows: NDArray[np.float64], egos: list[tuple[int, float, float]]) -> tuple[Ints, Ints]:
    """Return `Tracks.actors` and `Tracks.motion`. An actor that leaves and comes back has two tracks.

    `egos` has a row for each sample: its number of `rows`, and the ego's x and y in metres. The code works column by
    column and avoids slow functions of numpy, because every episode waits for the result.
    """
    table = np.array(egos)
    of_state = np.repeat(np.arange(len(egos)), table[:, 0].astype(np.int64))
    ego_x, ego_y = table[of_state, 1], table[of_state, 2]
    east, south = rows[:, WorldState.X] - ego_x, rows[:, WorldState.Y] - ego_y
    near = np.flatnonzero(east * east + south * south <= _RADIUS_M * _RADIUS_M)
    if not len(near):
        return np.empty((0, 6), np.int32), np.empty((0, 4), np.int32)
    order = near[np.argsort(rows[near, WorldState.ID], kind="stable")]  # stable: each actor's samples stay in order
    rows, sample = rows[order], of_state[order]
    ids, kinds, yaw = rows[:, WorldState.ID], rows[:, WorldState.KIND], rows[:, WorldState.YAW]
    first = np.ones(len(rows), bool)
    first[1:] = (ids[1:] != ids[:-1]) | (sample[1:] != sample[:-1] + 1) | (kinds[1:] != kinds[:-1])
    starts = np.flatnonzero(first)
    lengths = np.empty_like(starts)
    lengths[:-1], lengths[-1] = starts[1:] - starts[:-1], len(rows) - starts[-1]
    actors = np.empty((len(starts), 6), np.int32)
    actors[:, 0], actors[:, 1] = ids[starts], kinds[starts]
    actors[:, 2:4] = np.rint(rows[starts, WorldState.LENGTH : WorldState.WIDTH + 1] * _PER_M)
    actors[:, 4], actors[:, 5] = sample[starts], lengths
    motion = np.empty((len(rows), 4), np.int32)
    motion[:, :2] = np.rint(rows[:, WorldState.X : WorldState.Y + 1] * _PER_M)
    motion[:, 2] = _unwrapped(yaw, starts, lengths)
    motion[:, 3] = rows[:, WorldState.STATE]
    return actors, motion


def _unwrapped(yaw: NDArray[np.float64], starts: NDArray[np.int64], lengths: NDArray[np.int64]) -> Any:
    """Return angles in mrad that do not jump by a turn within a track."""
    turned = np.zeros(len(yaw))
    turned[1:] = yaw[1:] - yaw[:-1]
    turned -= 2.0 * np.pi * np.rint(turned / (2.0 * np.pi))
    summed = turned.cumsum()
    return np.rint((summed + np.repeat(yaw[starts] - summed[starts], lengths)) * _PER_RAD)


def _thinned(points: Any) -> list[Any]:
    listed = list(points)
    if len(listed) <= _MOST_POINTS:
        return listed
    step = -(-len(listed) // (_MOST_POINTS - 1))
    return [*listed[:-1:step], listed[-1]]
