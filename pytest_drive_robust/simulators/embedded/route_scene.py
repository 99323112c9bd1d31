"""Show what a route is about: its most telling moment, found without an agent, and its road and scenario in words."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pytest_drive_robust.arithmetic import scalars
from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.route import RoadOption, Route, ScenarioSpec
from pytest_drive_robust.domain.truth import Lane, LaneKind, LaneMap, WorldState
from pytest_drive_robust.jit.arrays import Floats
from pytest_drive_robust.simulators.embedded import state as c
from pytest_drive_robust.simulators.embedded.dense_route import DenseRoute
from pytest_drive_robust.simulators.embedded.geometry import place
from pytest_drive_robust.simulators.embedded.map import lanes_across
from pytest_drive_robust.simulators.embedded.state import DT_S
from pytest_drive_robust.simulators.embedded.world import World

_SHARE_OF_LIMIT = 0.6
_SLOWEST_MPS, _FASTEST_MPS = 5.0, 14.0
_AFTER_START_S = 1.2
_KEEP_AWAY_M = 9.0
_LOOK_AHEAD_M = 25.0
_COAST = Control()
_TURNS = {RoadOption.STRAIGHT: "straight on", RoadOption.RIGHT: "right turn", RoadOption.LEFT: "left turn"}


@dataclass(frozen=True, slots=True)
class RouteScene:
    """A built world at one moment.

    `ridden_m` is the ego's place in metres along the route; `walks` (n, 2, 2) are the (from, to) places of pedestrians
    in metres.
    """

    route: Route
    world: World
    state: WorldState
    ridden_m: float
    walks: Floats


def telling_moment(route: Route, *, seed: int = 0) -> RouteScene:
    """Return the world of `route` during its scenario: one second after the first triggered actor has started.

    The ego moves along its route on rails at 0.6 of the speed limit and stops short of bodies in its way. A scenario
    without triggered actors is shown 25 m after the trigger point. Raises `RouteError` for a route that cannot be
    built.
    """
    world = World(route, seed=seed)
    waiting = world.state.actor_ints[:, c.I_PHASE] == c.PHASE_WAITING
    ridden, since_start_s = 0.0, 0.0
    last = min(world.dense.length_m, world.dense.trigger_m + (70.0 if waiting.any() else _LOOK_AHEAD_M))
    while ridden < last and since_start_s < _AFTER_START_S:
        speed = _speed_at(world, ridden)
        if _is_blocked(world):
            break
        _put_ego(world, ridden, speed)
        world.tick(_COAST)
        ridden += speed * DT_S
        if (world.state.actor_ints[waiting, c.I_PHASE] >= c.PHASE_SCRIPT).any():
            since_start_s += DT_S
    _put_ego(world, min(ridden, last), _speed_at(world, ridden))
    return RouteScene(route, world, world.now(), ridden, _walks(world))


def _speed_at(world: World, ridden_m: float) -> float:
    row = int(np.searchsorted(world.dense.s, ridden_m).clip(0, len(world.dense.rows) - 1))
    return float(np.clip(_SHARE_OF_LIMIT * world.dense.rows[row, 3], _SLOWEST_MPS, _FASTEST_MPS))


def _put_ego(world: World, ridden_m: float, speed_mps: float) -> None:
    """Put the ego `ridden_m` along the route; an ego that starts beside the route reaches the route within 12 m."""
    aside = world.stage.start_right_m * max(0.0, 1.0 - ridden_m / 12.0)
    x, y, yaw = place(world.dense.rows[:, :3], ridden_m, aside)
    world.state.ego[[c.EGO_X, c.EGO_Y, c.EGO_YAW, c.EGO_V]] = x, y, yaw, speed_mps


def _is_blocked(world: World) -> bool:
    """Return whether a solid body is close ahead of the ego."""
    ego, ints = world.state.ego, world.state.actor_ints
    there = (ints[:, c.I_ACTIVE] == c.PRESENT) & (ints[:, c.I_SOLID] == 1)
    away = world.state.actors[there][:, [c.A_X, c.A_Y]] - ego[[c.EGO_X, c.EGO_Y]]
    cos_yaw, sin_yaw = scalars.cos(ego[c.EGO_YAW]), scalars.sin(ego[c.EGO_YAW])
    ahead, right = away[:, 0] * cos_yaw + away[:, 1] * sin_yaw, away[:, 1] * cos_yaw - away[:, 0] * sin_yaw
    half = world.state.actors[there][:, c.A_LENGTH] / 2.0
    return bool(((ahead > 0.0) & (ahead - half < _KEEP_AWAY_M) & (np.abs(right) < 1.6)).any())


def _walks(world: World) -> Floats:
    ways = []
    for actor, whole in zip(world.stage.cast.rows, world.stage.cast.ints, strict=True):
        if whole[c.I_MODE] == c.MODE_WALK:
            path = world.stage.paths[int(whole[c.I_PATH])]
            end = min(float(actor[c.A_END_M]), 40.0)
            ways.append((path[0, :2], place(path, end)[:2]))
    return np.array(ways, np.float64).reshape(-1, 2, 2)


def describe_road(dense: DenseRoute) -> str:
    """Return `"1 + 1 lanes, parking, left turn at 24 m, lights"`: lanes of the route's way + lanes of the other."""
    lanes = dense.lane_map.lanes
    own = lanes[int(dense.lanes[int(np.searchsorted(dense.s, dense.trigger_m).clip(0, len(dense.s) - 1))])]
    if own.junction:
        own = lanes[int(dense.lanes[0])]
    words = [_lanes(dense.lane_map, own)]
    way = dense.first_passage()
    if way is not None:
        row = dense.first_junction_row()
        assert row is not None
        words.append(f"{_TURNS[RoadOption.through_junction(way.turn_rad)]} at {dense.s[row]:.0f} m")
        stops = dense.junction_stops()
        if stops:
            words.append("lights" if dense.lane_map.stop_lines[stops[0]].is_light else "stop signs")
    for start, _, side in dense.lane_changes():
        words.append(f"{'right' if side > 0 else 'left'} lane at {dense.s[start]:.0f} m")
    return ", ".join(words)


def _lanes(lane_map: LaneMap, own: Lane) -> str:
    lanes = lane_map.lanes
    slice_ = [own, *(lane for side in ("left", "right") for lane in lanes_across(lanes, own, side))]
    driving = [lane for lane in slice_ if lane.kind is LaneKind.DRIVING]
    along = sum(scalars.cos(lane.centre[0, 2] - own.centre[0, 2]) > 0.0 for lane in driving)
    others = len(driving) - along
    words = f"{along} + {others} lanes" if others else f"{along} lane{'s' * (along > 1)}, one way"
    kinds = {lane.kind for lane in slice_}
    return words + ", parking" * (LaneKind.PARKING in kinds) + ", bicycles" * (LaneKind.BIKING in kinds)


def describe_parameters(spec: ScenarioSpec) -> str:
    """Return the route file's parameters, coordinates left out: `"distance 40, source_dist_interval 15 to 25"`."""
    words = [f"{name} {text}" for name, text in spec.texts.items()]
    for name, given in spec.parameters.items():
        if "value" in given:
            words.append(f"{name} {given['value']:g}")
        elif "from" in given and "to" in given:
            words.append(f"{name} {given['from']:g} to {given['to']:g}")
        elif "x" in given:
            words.append(name)
    return ", ".join(words)
