"""One episode's world: built from a route and a seed, advanced by controls, all arrays."""

from __future__ import annotations

import math

import numpy as np

from pytest_drive_robust.arithmetic import arrays, scalars
from pytest_drive_robust.arithmetic.series import wrap_angle
from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.route import Route
from pytest_drive_robust.domain.truth import EgoState, GroundTruth, LaneMap, WorldState
from pytest_drive_robust.errors import SimulationError, UnknownNameError
from pytest_drive_robust.jit.arrays import Floats, Ints
from pytest_drive_robust.simulators.base import SimulatorOptions
from pytest_drive_robust.simulators.embedded import state as c
from pytest_drive_robust.simulators.embedded.dense_route import lay_route
from pytest_drive_robust.simulators.embedded.geometry import moved, seen_from
from pytest_drive_robust.simulators.embedded.kernels.entry_points import (
    actor_rows,
    finish,
    pack_world,
    settle,
    settle_turn,
    tick,
)
from pytest_drive_robust.simulators.embedded.scenarios import SCENARIOS
from pytest_drive_robust.simulators.embedded.stage import Stage
from pytest_drive_robust.simulators.embedded.state import State, Statics
from pytest_drive_robust.simulators.embedded.statics import EGO_LENGTH_M, EGO_WIDTH_M, build_statics

_STOPPING_MPS2 = 4.0
_NEAR_START_M = 15.0


class World:
    """A route with its actors: `statics` never changes, `state` holds everything that changes.

    Raises `RouteError` when the route cannot be laid or its scenario cannot be staged there.
    """

    def __init__(self, route: Route, *, seed: int, options: SimulatorOptions | None = None) -> None:
        self.dense = lay_route(route)
        kind = SCENARIOS.get(route.scenario.type)
        if kind is None:
            raise UnknownNameError.of("scenario type", route.scenario.type, SCENARIOS, hint=f"(route {route.id})")
        self.stage = Stage(self.dense, seed=seed, ranges={**kind.parameters, **kind.intervals})
        kind.build(self.stage)
        actors, actor_ints, flows, flow_ints, gaps = self.stage.cast.freeze()
        self.statics = build_statics(self.stage, kind, gaps, options or SimulatorOptions())
        criteria, criteria_ints = _criteria_at_start()
        self.state = State(
            clock=np.array([0, -1], dtype=np.int64),
            ego=_ego_at_start(self.stage),
            actors=actors,
            actor_ints=actor_ints,
            flows=flows,
            flow_ints=flow_ints,
            lights=np.zeros(len(self.lane_map.stop_lines), dtype=np.int64),
            criteria=criteria,
            criteria_ints=criteria_ints,
            events=np.zeros((c.EVENT_CAPACITY, c.EVENT_COLUMNS)),
        )
        self._rows = np.zeros((len(actors), WorldState.COLUMNS))
        self._arrays = pack_world(self.statics, self.state)
        settle(self._arrays)
        _clear_start(self.statics, self.state)

    @property
    def lane_map(self) -> LaneMap:
        """The lane map of the route's town."""
        return self.dense.lane_map

    def tick(self, control: Control) -> None:
        """Advance by 50 ms."""
        tick(self._arrays, float(control.throttle), float(control.steer), float(control.brake))

    def close_criteria(self) -> None:
        """Judge the criteria that are known only at the end; call once per episode."""
        finish(self._arrays)

    def now(self) -> WorldState:
        """Return the dynamic world of this moment; its arrays belong to the caller."""
        ego = self.state.ego
        count = actor_rows(self._arrays, self._rows)
        return WorldState(
            tick=int(self.state.clock[c.TICK]),
            ego=EgoState(
                x_m=float(ego[c.EGO_X]),
                y_m=float(ego[c.EGO_Y]),
                yaw_rad=float(ego[c.EGO_YAW]),
                speed_mps=float(ego[c.EGO_V]),
                forward_mps2=float(ego[c.EGO_FORWARD]),
                right_mps2=float(ego[c.EGO_RIGHT]),
                yaw_rate_radps=float(ego[c.EGO_YAW_RATE]),
                length_m=EGO_LENGTH_M,
                width_m=EGO_WIDTH_M,
            ),
            actors=self._rows[:count].copy(),
            lights=self.state.lights.copy(),
        )

    def truth(self, now: WorldState) -> GroundTruth:
        """Return `now` together with the map and the route."""
        return GroundTruth(now, self.lane_map, self.dense.rows, int(self.state.criteria_ints[c.CI_PROGRESS]))

    def snapshot(self) -> State:
        """Return a copy of all changing arrays, for `restore`, to branch from this moment."""
        return State(*(array.copy() for array in self.state))

    def restore(self, snapshot: State) -> None:
        """Restore a snapshot of this world."""
        for mine, theirs in zip(self.state, snapshot, strict=True):
            mine[...] = theirs

    def place_ego(self, x_m: float, y_m: float, yaw_rad: float, speed_mps: float) -> None:
        """Move the ego; see `EmbeddedSimulator.place_ego`. Raises `SimulationError` for an invalid place or speed."""
        if not all(map(math.isfinite, (x_m, y_m, yaw_rad, speed_mps))) or speed_mps < 0.0:
            given = f"x {x_m!r}, y {y_m!r}, yaw {yaw_rad!r}, speed {speed_mps!r}"
            raise SimulationError(f"the ego cannot be put at {given}: expected finite numbers and a speed of 0 or more")
        ego = self.state.ego
        ego[[c.EGO_X, c.EGO_Y, c.EGO_V]] = x_m, y_m, speed_mps
        ego[c.EGO_YAW] = wrap_angle(yaw_rad)
        if speed_mps == 0.0:
            ego[c.EGO_FORWARD] = 0.0
        settle_turn(self._arrays)


def _ego_at_start(stage: Stage) -> Floats:
    ego = np.zeros(c.EGO_COLUMNS)
    x, y, yaw = moved(tuple(stage.dense.rows[0, :3]), 0.0, stage.start_right_m)
    ego[[c.EGO_X, c.EGO_Y, c.EGO_YAW, c.EGO_V]] = x, y, wrap_angle(yaw), stage.start_mps
    return ego


def _criteria_at_start() -> tuple[Floats, Ints]:
    criteria = np.zeros(c.CRITERIA_COLUMNS)
    criteria[[c.C_LAST_HIT_X, c.C_LAST_HIT_Y]] = 1e9  # far away: nothing was hit yet
    ints = np.zeros(c.CRITERIA_INTS, dtype=np.int64)
    ints[[c.CI_LAST_LANE, c.CI_STOP_LINE, c.CI_LAST_LIGHT]] = -1
    return criteria, ints


def _clear_start(statics: Statics, state: State) -> None:
    """Remove flow cars that would hit an actor of the scenario, or that are near the ego's start on its own lane."""
    active = state.actor_ints[:, c.I_ACTIVE] == c.PRESENT
    flowing = state.actor_ints[:, c.I_FLOW] >= 0
    placed = state.actors[active & ~flowing & (state.actor_ints[:, c.I_SOLID] == 1)]
    placed_cos, placed_sin = arrays.cos(placed[:, c.A_YAW]), arrays.sin(placed[:, c.A_YAW])
    x, y, yaw = (float(value) for value in state.ego[[c.EGO_X, c.EGO_Y, c.EGO_YAW]])
    for i in np.flatnonzero(active & flowing):
        if _runs_into(state.actors[i], placed, placed_cos, placed_sin):
            state.actor_ints[i, c.I_ACTIVE] = c.ABSENT
        there = state.actors[i, [c.A_X, c.A_Y]]
        is_near = scalars.hypot(there[0] - x, there[1] - y) < _NEAR_START_M
        if is_near and abs(seen_from((x, y, yaw), there)[1]) < statics.ego_width_m:
            state.actor_ints[i, c.I_ACTIVE] = c.ABSENT


def _runs_into(actor: Floats, placed: Floats, cos: Floats, sin: Floats) -> bool:
    """Return whether an actor overlaps one of `placed`, or is too near behind or ahead to stop.

    `cos` and `sin` are those of the yaws of `placed`.
    """
    dx, dy = actor[c.A_X] - placed[:, c.A_X], actor[c.A_Y] - placed[:, c.A_Y]
    long, wide = placed[:, c.A_LENGTH] + actor[c.A_LENGTH], placed[:, c.A_WIDTH] + actor[c.A_WIDTH]
    to_stop = 2.0 + actor[c.A_V] * actor[c.A_V] / (2.0 * _STOPPING_MPS2)
    inside = (np.abs(dx * cos + dy * sin) < long / 2.0 + to_stop) & (np.abs(dy * cos - dx * sin) < wide / 2.0)
    return bool(inside.any())
