"""The numbers behind SimLingo's commentary: facts about a moment from which its sentence is made."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drive_robust_agents._planning.projection import project_all
from drive_robust_agents.training.data.labels import LOOK_M, ExpertMoment, body_ahead
from pytest_drive_robust.domain.truth import ActorKind, LightState, WorldState

__all__ = ["FACTS", "NO_LIGHT", "fact_labels"]

FACTS = (
    "light",  # state of the next stop line: -1 none, 0 green, 1 yellow, 2 red, 3 stop sign without a stop yet
    "light_m",  # metres from the front bumper to that line (100: none)
    "lead_m",  # metres to the vehicle ahead in the way, bumper to bumper (100: none)
    "lead_mps",  # its speed along the way
    "walker_m",  # metres to a pedestrian or bicycle near the way (100: none)
    "obstacle_m",  # metres to a static obstacle in the way: cone, barrier, container, sign, door (100: none)
    "junction_m",  # metres from the front bumper to the next junction, 0 within one (100: none)
    "lane_width_m",
    "lane_left",  # 1 where a lane on the left leads the same way
    "lane_right",  # 1 where a lane on the right leads the same way
    "limit_mps",  # the speed limit here
    "night",  # 1 when the sun is down
    "wish_mps2",  # the acceleration that the expert chose
    "passing",  # 1 while the ego passes an obstacle or moves out of the way of a siren
    "waiting",  # 1 while the ego waits for a gap: to leave a parking space, to change lanes, to pass an obstacle
    "siren",  # 1 while an emergency vehicle with its siren on drives behind, within 70 m
)
"""The columns of `facts`."""

NO_LIGHT = -1.0
_LIGHT_LOOK_M, _LIGHT_PAST_M = 60.0, 2.0
_WALKER_LOOK_M, _WALKER_BESIDE_M = 40.0, 4.5
_SIREN_M = 70.0


def fact_labels(here: ExpertMoment) -> NDArray[np.float32]:
    """Return (16,) float32: the numbers of `FACTS`."""
    truth, intent, ego = here.truth, here.intent, here.ego
    scene, row = intent.scene, intent.row
    actors, kinds = truth.state.actors, truth.state.actors[:, WorldState.KIND]
    light, light_m = _light(here)
    lead_m, lead_mps = body_ahead(here, actors[kinds <= ActorKind.EMERGENCY])
    still = (kinds > ActorKind.PEDESTRIAN) & (kinds != ActorKind.BUILDING) & (kinds != ActorKind.DIRT)
    obstacle_m, _ = body_ahead(here, actors[still])
    left, right = (scene.neighbour(row, side) for side in ("left", "right"))
    found: dict[str, Any] = {
        "light": light,
        "light_m": light_m,
        "lead_m": min(lead_m, LOOK_M),
        "lead_mps": lead_mps if lead_m < LOOK_M else 0.0,
        "walker_m": _walker_m(here),
        "obstacle_m": min(obstacle_m, LOOK_M),
        "junction_m": _junction_m(here),
        "lane_width_m": scene.lane_at(row).width_m,
        "lane_left": left[0] is not None and left[1],
        "lane_right": right[0] is not None and right[1],
        "limit_mps": scene.route[int(np.clip(row, 0, scene.count - 1)), 3],
        "night": here.night,
        "wish_mps2": intent.acceleration_mps2,
        "passing": intent.passing,
        "waiting": intent.waiting,
        "siren": _siren(truth.state, ego.x_m, ego.y_m, ego.yaw_rad),
    }
    return np.array([float(found[name]) for name in FACTS], dtype=np.float32)


def _light(here: ExpertMoment) -> tuple[float, float]:
    """Return (state, metres) of the next stop line on the route that still counts."""
    intent, now = here.intent, here.truth.state
    front = intent.row + 0.5 * here.ego.length_m
    for index, at in sorted(intent.scene.stops, key=lambda stop: stop[1]):
        state = int(now.lights[index])
        honoured = state == LightState.STOP_SIGN and intent.rule_row > at
        if -_LIGHT_PAST_M < at - front < _LIGHT_LOOK_M and not honoured:
            return float(state), max(at - front, 0.0)
    return NO_LIGHT, LOOK_M


def _walker_m(here: ExpertMoment) -> float:
    now, intent, ego = here.truth.state, here.intent, here.ego
    kinds = now.actors[:, WorldState.KIND]
    walkers = now.actors[(kinds == ActorKind.PEDESTRIAN) | (kinds == ActorKind.BICYCLE)]
    if len(walkers) == 0:
        return LOOK_M
    places = np.ascontiguousarray(walkers[:, [WorldState.X, WorldState.Y, WorldState.YAW]])
    at = project_all(intent.line, int(intent.row) - 10, int(intent.row + _WALKER_LOOK_M) + 10, places)
    ahead = at[:, 0] - intent.row - 0.5 * (ego.length_m + walkers[:, WorldState.LENGTH])
    near = (np.abs(at[:, 1]) < _WALKER_BESIDE_M) & (at[:, 0] > intent.row) & (ahead < _WALKER_LOOK_M)
    return float(np.maximum(ahead[near], 0.0).min(initial=LOOK_M))


def _junction_m(here: ExpertMoment) -> float:
    half, row = 0.5 * here.ego.length_m, here.intent.row
    for first, last in here.intent.scene.junctions:
        if last > row - half:
            return float(np.clip(first - row - half, 0.0, LOOK_M))
    return LOOK_M


def _siren(now: WorldState, x: float, y: float, yaw: float) -> bool:
    rows = now.actors[(now.actors[:, WorldState.KIND] == ActorKind.EMERGENCY) & (now.actors[:, WorldState.SPEED] > 1.0)]
    dx, dy = rows[:, WorldState.X] - x, rows[:, WorldState.Y] - y
    ahead = dx * math.cos(yaw) + dy * math.sin(yaw)
    same_way = np.cos(rows[:, WorldState.YAW] - yaw) > 0.7
    return bool(np.any(same_way & (ahead < -3.0) & (np.hypot(dx, dy) < _SIREN_M)))
