"""One episode's world: built from a route and a seed, advanced by controls, all arrays."""

from __future__ import annotations

import math

import numpy as np

from pytest_drive_robust.arithmetic import arrays, scalars
from pytest_drive_robust.arithmetic.series import wrap_angle
from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.route import Route
from pytest_drive_robust.domain.truth import EgoState, GroundTruth, LaneKind, LaneMap, WorldState
from pytest_drive_robust.errors import RouteError, SimulationError, UnknownNameError
from pytest_drive_robust.jit.arrays import Floats, Ints
from pytest_drive_robust.simulators.base import SimulatorOptions
from pytest_drive_robust.simulators.embedded import state as c
from pytest_drive_robust.simulators.embedded.dense_route import DenseRoute, lay_route
from pytest_drive_robust.simulators.embedded.kernels.entry_points import (
    actor_rows,
    finish,
    pack_world,
    settle,
    settle_turn,
    tick,
)
from pytest_drive_robust.simulators.embedded.light_programs import RED, compile_programs
from pytest_drive_robust.simulators.embedded.map import leftmost
from pytest_drive_robust.simulators.embedded.scenarios import SCENARIOS, ScenarioType
from pytest_drive_robust.simulators.embedded.stage import Stage
from pytest_drive_robust.simulators.embedded.state import DT_S, State, Statics

EGO_LENGTH_M, EGO_WIDTH_M = 4.892, 1.837
"""`vehicle.lincoln.mkz_2020`, the leaderboard's ego."""

_NOISE_TICKS = 199
_STOPPING_MPS2 = 4.0


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
        self.statics = _statics(self.dense, self.stage, kind, gaps, options or SimulatorOptions())
        criteria, criteria_ints = _criteria_at_start()
        self.state = State(
            clock=np.array([0, -1], dtype=np.int64),
            ego=_ego_at_start(self.dense, self.stage),
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
        """Advance by `DT_S` seconds."""
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


def _ego_at_start(dense: DenseRoute, stage: Stage) -> Floats:
    ego = np.zeros(c.EGO_COLUMNS)
    x, y, yaw = dense.rows[0, :3]
    right = stage.start_right_m
    ego[[c.EGO_X, c.EGO_Y]] = x - right * scalars.sin(yaw), y + right * scalars.cos(yaw)
    ego[[c.EGO_YAW, c.EGO_V]] = wrap_angle(yaw), stage.start_mps
    return ego


def _criteria_at_start() -> tuple[Floats, Ints]:
    criteria = np.zeros(c.CRITERIA_COLUMNS)
    criteria[[c.C_LAST_HIT_X, c.C_LAST_HIT_Y]] = 1e9  # far away: nothing was hit yet
    ints = np.zeros(c.CRITERIA_INTS, dtype=np.int64)
    ints[[c.CI_LAST_LANE, c.CI_STOP_LINE, c.CI_LAST_LIGHT]] = -1
    return criteria, ints


def _clear_start(statics: Statics, state: State) -> None:
    """Remove flow cars that overlap the ego's start, or that would hit an actor of the scenario.

    Flow cars nearer than 15 m on the ego's own lane are removed, too.
    """
    active = state.actor_ints[:, c.I_ACTIVE] == c.PRESENT
    flowing = state.actor_ints[:, c.I_FLOW] >= 0
    placed = state.actors[active & ~flowing & (state.actor_ints[:, c.I_SOLID] == 1)]
    placed_cos, placed_sin = arrays.cos(placed[:, c.A_YAW]), arrays.sin(placed[:, c.A_YAW])
    cos, sin = scalars.cos(state.ego[c.EGO_YAW]), scalars.sin(state.ego[c.EGO_YAW])
    for i in np.flatnonzero(active & flowing):
        if _runs_into(state.actors[i], placed, placed_cos, placed_sin):
            state.actor_ints[i, c.I_ACTIVE] = c.ABSENT
        dx, dy = state.actors[i, c.A_X] - state.ego[c.EGO_X], state.actors[i, c.A_Y] - state.ego[c.EGO_Y]
        if scalars.hypot(dx, dy) < 15.0 and abs(-dx * sin + dy * cos) < statics.ego_width_m:
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


def _statics(dense: DenseRoute, stage: Stage, kind: ScenarioType, gaps: Floats, options: SimulatorOptions) -> Statics:
    lane_map = dense.lane_map
    usable = [lane for lane in lane_map.lanes if lane.kind in (LaneKind.DRIVING, LaneKind.PARKING)]
    stops = lane_map.stop_lines
    before, states, until = compile_programs([stage.programs.get(line.index, RED) for line in stops])
    stop_s, stop_line = _path_stops(stage.paths, dense)
    lengths = [len(path) for path in stage.paths]
    steps = [scalars.hypot(*(path[1, :2] - path[0, :2])) for path in stage.paths]
    if any(step <= 0.0 for step in steps):
        raise RouteError(f"route {dense.route.id}: an actor's path has no length")
    return Statics(
        dt_s=DT_S,
        tick_cap=options.tick_cap,
        stuck_stop_s=np.inf if options.stuck_stop_s is None else float(options.stuck_stop_s),
        route=dense.rows,
        route_s=dense.s,
        trigger_m=float(dense.trigger_m),
        scenario_end_m=float(stage.end_m),
        blocked_test_off=int(kind.blocked_test_off),
        two_ways=kind.two_ways,
        two_ways_near=np.array(stage.two_ways_near),
        emergency_actor=stage.emergency_actor,
        ego_length_m=EGO_LENGTH_M,
        ego_width_m=EGO_WIDTH_M,
        paths=np.concatenate(stage.paths),
        path_start=np.concatenate([[0], np.cumsum(lengths)]).astype(np.int64),
        path_step=np.array(steps),
        path_stop_m=stop_s,
        path_stop_line=stop_line,
        lanes=np.concatenate([lane.centre for lane in usable]),
        lane_of=np.concatenate([np.full(len(lane.centre), lane.index) for lane in usable]).astype(np.int64),
        lane_start=np.concatenate([[0], np.cumsum([len(lane.centre) for lane in usable])]).astype(np.int64),
        lane_step_m=max(float(arrays.hypot(*np.diff(lane.centre[:, :2], axis=0).T).max()) for lane in usable),
        lane_width=np.array([lane.width_m for lane in lane_map.lanes]),
        lane_junction=np.array([int(lane.junction) for lane in lane_map.lanes], dtype=np.int64),
        stop_lines=np.array([[s.x_m, s.y_m, s.heading_rad, s.width_m] for s in stops]).reshape(-1, 4),
        stop_is_light=np.array([int(s.is_light) for s in stops], dtype=np.int64),
        stop_light=np.array([leftmost(lane_map, s.lane) for s in stops], dtype=np.int64),
        light_states=states,
        light_until_s=until,
        light_before=before,
        flow_gaps=gaps,
        buildings=lane_map.buildings,
        patches=np.array(stage.patches).reshape(-1, 2),
        patch_noise=_patch_noise(stage),
        survey=np.zeros((len(stage.paths), len(stage.cast.rows) + 1, c.SURVEY_COLUMNS)),
    )


def _patch_noise(stage: Stage) -> Floats:
    """Draw the noise of dirt on throttle and steer, (patches, n, 2); each patch draws a sign for each.

    Source: Bench2Drive `scenario_runner/srunner/scenarios/control_loss.py`.
    """
    noise = np.zeros((len(stage.patches), _NOISE_TICKS, 2))
    draws = stage.draws("dirt")
    for patch in noise:
        push, side = (1.0 if draws.random() < 0.5 else -1.0 for _ in range(2))
        patch[:, 0] = draws.normals(push * 0.03, 0.01, _NOISE_TICKS)
        patch[:, 1] = draws.normals(side * 0.055, 0.015, _NOISE_TICKS)
    return noise


def _path_stops(paths: list[Floats], dense: DenseRoute) -> tuple[Floats, Ints]:
    """Return by path the metres to its first light's stop line (infinity: none) and that line's index (-1: none)."""
    stop_s = np.full(len(paths), np.inf)
    stop_line = np.full(len(paths), -1, dtype=np.int64)
    for p, path in enumerate(paths):
        step = scalars.hypot(*(path[1, :2] - path[0, :2]))
        for line in dense.lane_map.stop_lines:
            away = arrays.hypot(path[:, 0] - line.x_m, path[:, 1] - line.y_m)
            k = int(np.argmin(away))
            along = scalars.cos(path[k, 2] - line.heading_rad) > 0.8
            if line.is_light and along and away[k] < 1.0 and k * step < stop_s[p]:
                stop_s[p], stop_line[p] = k * step, line.index
    return stop_s, stop_line
