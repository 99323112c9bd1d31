"""Build the arrays that stay constant within an episode from a filled stage."""

from __future__ import annotations

import numpy as np

from pytest_drive_robust.arithmetic import arrays, scalars
from pytest_drive_robust.domain.truth import LaneKind, StopLine
from pytest_drive_robust.errors import RouteError
from pytest_drive_robust.jit.arrays import Floats, Ints
from pytest_drive_robust.simulators.base import SimulatorOptions
from pytest_drive_robust.simulators.embedded import state as c
from pytest_drive_robust.simulators.embedded.light_programs import RED, compile_programs
from pytest_drive_robust.simulators.embedded.map import leftmost
from pytest_drive_robust.simulators.embedded.scenarios import ScenarioType
from pytest_drive_robust.simulators.embedded.stage import Stage
from pytest_drive_robust.simulators.embedded.state import DT_S, Statics

EGO_LENGTH_M, EGO_WIDTH_M = 4.892, 1.837
"""`vehicle.lincoln.mkz_2020`, the leaderboard's ego."""

_NOISE_TICKS = 199
_ON_PATH_M, _SAME_WAY = 1.0, 0.8
"""A stop line belongs to a path that passes nearer than this and heads the same way: least cosine of the angle."""


def build_statics(stage: Stage, kind: ScenarioType, gaps: Floats, options: SimulatorOptions) -> Statics:
    """Return the constant arrays; `gaps` (flows, draws) come from `Cast.freeze`.

    Raises `RouteError` when a path of an actor has no length.
    """
    dense, lane_map = stage.dense, stage.dense.lane_map
    usable = [lane for lane in lane_map.lanes if lane.kind in (LaneKind.DRIVING, LaneKind.PARKING)]
    stops = lane_map.stop_lines
    before, states, until = compile_programs([stage.programs.get(line.index, RED) for line in stops])
    lengths = [len(path) for path in stage.paths]
    steps = [scalars.hypot(*(path[1, :2] - path[0, :2])) for path in stage.paths]
    if any(step <= 0.0 for step in steps):
        raise RouteError(f"route {dense.route.id}: an actor's path has no length")
    stop_m, stop_line = _path_stops(stage.paths, steps, stops)
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
        path_stop_m=stop_m,
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


def _path_stops(paths: list[Floats], steps: list[float], stops: tuple[StopLine, ...]) -> tuple[Floats, Ints]:
    """Return by path the metres to its first light's stop line (infinity: none) and that line's index (-1: none)."""
    stop_m = np.full(len(paths), np.inf)
    stop_line = np.full(len(paths), -1, dtype=np.int64)
    for p, (path, step_m) in enumerate(zip(paths, steps, strict=True)):
        for line in stops:
            away = arrays.hypot(path[:, 0] - line.x_m, path[:, 1] - line.y_m)
            k = int(np.argmin(away))
            along = scalars.cos(path[k, 2] - line.heading_rad) > _SAME_WAY
            if line.is_light and along and away[k] < _ON_PATH_M and k * step_m < stop_m[p]:
                stop_m[p], stop_line[p] = k * step_m, line.index
    return stop_m, stop_line
