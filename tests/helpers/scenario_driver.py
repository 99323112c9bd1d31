"""A driver for scenario tests: follows the route at a set speed and a set distance beside it, and looks at nothing."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from drive_robust_agents._vehicle import mkz
from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.route import Route
from pytest_drive_robust.simulators.embedded import state as c
from pytest_drive_robust.simulators.embedded.generate import draw_route
from pytest_drive_robust.simulators.embedded.geometry import project
from pytest_drive_robust.simulators.embedded.scenarios import SCENARIOS
from pytest_drive_robust.simulators.embedded.world import World

Floats = NDArray[np.float64]


@lru_cache(maxsize=128)
def drawn(name: str, number: int = 0, *, seed: int = 5) -> Route:
    """Draw a route of a scenario type, on its site `number`."""
    return draw_route(SCENARIOS[name], number=number, seed=seed, route_id="1")


def staged(name: str, number: int = 0, *, seed: int = 0, **parameters: float) -> World:
    """Build a world of a scenario type with some of its parameters replaced."""
    route = drawn(name, number)
    given = {**route.scenario.parameters, **{key: {"value": value} for key, value in parameters.items()}}
    return World(replace(route, scenario=replace(route.scenario, parameters=given)), seed=seed)


def control(world: World, *, speed_mps: float, right_m: float = 0.0) -> Control:
    """Pursue the route, shifted by `right_m`, and hold a speed with pedals."""
    ego, rows = world.state.ego, world.dense.rows
    away = np.hypot(rows[:, 0] - ego[c.EGO_X], rows[:, 1] - ego[c.EGO_Y])
    reach = 3.5 + 0.4 * ego[c.EGO_V]
    x, y, yaw, _ = rows[min(int(np.argmin(away)) + round(reach), len(rows) - 1)]
    dx, dy = x - right_m * math.sin(yaw) - ego[c.EGO_X], y + right_m * math.cos(yaw) - ego[c.EGO_Y]
    cos, sin = math.cos(ego[c.EGO_YAW]), math.sin(ego[c.EGO_YAW])
    ahead, beside = dx * cos + dy * sin, -dx * sin + dy * cos
    curvature = 2.0 * beside / max(ahead * ahead + beside * beside, 1.0)
    if speed_mps <= 0.0:
        return Control(brake=1.0)
    now_mps = float(ego[c.EGO_V])
    throttle, brake = mkz.pedals(now_mps, 3.0 * (speed_mps - now_mps))
    return Control(throttle=throttle, steer=mkz.steer(curvature), brake=brake)


def drive(
    world: World,
    seconds: float,
    *,
    speed_mps: float,
    right_m: float = 0.0,
    until: Callable[[World], bool] = lambda world: False,
) -> bool:
    """Drive on until `until` holds (True) or the time or the route is over (False)."""
    for _ in range(round(seconds / 0.05)):
        if until(world):
            return True
        if int(world.state.criteria_ints[c.CI_PROGRESS]) >= len(world.dense.rows) - 4:
            return until(world)
        world.tick(control(world, speed_mps=speed_mps, right_m=right_m))
    return until(world)


def collisions(world: World) -> list[int]:
    """Return the actors that the ego has hit."""
    return [int(row[c.EV_ACTOR]) for row in world.state.noted() if row[c.EV_KIND] == c.EVENT_COLLISION]


def actors_of(world: World, *kinds: int, flows: bool = False) -> list[int]:
    """Return numbers of the actors of these kinds; those of flows only when asked for."""
    ints = world.state.actor_ints
    return [k for k in range(len(ints)) if ints[k, c.I_KIND] in kinds and (flows or ints[k, c.I_FLOW] < 0)]


def beside_route(world: World, actor: int) -> tuple[float, float]:
    """Return (metres ahead of the trigger, metres to the right of the ego's way) of an actor's middle."""
    row = world.state.actors[actor]
    s, right = project(world.stage.paths[world.stage.ego_path], float(row[c.A_X]), float(row[c.A_Y]))
    return s - world.stage.on_ego_path(0.0), right


def away_m(world: World, actor: int) -> float:
    """Return the distance of an actor's middle from the ego's."""
    row, ego = world.state.actors[actor], world.state.ego
    return math.hypot(row[c.A_X] - ego[c.EGO_X], row[c.A_Y] - ego[c.EGO_Y])
