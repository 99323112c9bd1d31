"""Move the actors: the intelligent driver model, the leader ahead, scripts, lamps."""

from __future__ import annotations

import math

from pytest_drive_robust.arithmetic.compiled import atan2, cos_sin
from pytest_drive_robust.domain.truth import ActorState, LightState
from pytest_drive_robust.jit.arrays import Floats, Ints
from pytest_drive_robust.jit.kernels import inner
from pytest_drive_robust.simulators.embedded import state as c
from pytest_drive_robust.simulators.embedded.kernels.paths import path_pose
from pytest_drive_robust.simulators.embedded.kernels.scenario import run_script
from pytest_drive_robust.simulators.embedded.kernels.world_arrays import WorldArrays

IDM_GAP_M, IDM_HEADWAY_S, IDM_COMFORT_MPS2 = 2.0, 1.1, 2.5
"""Gap at rest, time gap and comfortable braking of all drivers; our own numbers."""
LOOK_AHEAD_M = 70.0
"""Greatest distance of a body that a driver brakes for."""
LEASH_FREE_M, LEASH_END_M = 30.0, 45.0
"""Distances from the ego where the leash of the traffic begins to act, and acts fully."""
SIDEWAYS_SHARE = 0.5
"""Greatest speed sideways, as a share of the speed forward."""
NOTICED_LATE_M, NOTICED_SHARE = 1.0, 0.95
"""A driver with `SEES_LATE` brakes only for bodies whose middle is so near to his path, and that are slower than this
share of his target speed."""
_RED = int(LightState.RED)
_YELLOW = int(LightState.YELLOW)
_BRAKING = int(ActorState.BRAKING)
_LEFT = int(ActorState.INDICATOR_LEFT)
_RIGHT = int(ActorState.INDICATOR_RIGHT)
_SIREN = int(ActorState.SIREN)


@inner
def idm(v: float, target: float, gap: float, leader_v: float, accel_max: float, brake_max: float) -> float:
    """Return the acceleration of the intelligent driver model [m/s2], within the actor's limits.

    Source: Treiber, Hennecke and Helbing, "Congested traffic states in empirical observations and microscopic
    simulations", Physical Review E 62, 2000. The original adds up the free and the interaction term; here the lesser of
    the two accelerations counts. Above its target speed a car brakes comfortably.
    """
    if target < 0.05:
        free = -brake_max if v > 0.0 else 0.0
    elif v > target:
        free = -IDM_COMFORT_MPS2 * min(1.0, v / target - 1.0 + 0.2)
    else:
        share = (v / target) * (v / target)
        free = accel_max * (1.0 - share * share)
    if gap < 1e17:
        closing = v * (v - leader_v) / (2.0 * math.sqrt(accel_max * IDM_COMFORT_MPS2))
        desired = (IDM_GAP_M + max(0.0, v * IDM_HEADWAY_S + closing)) / max(gap, 0.1)
        free = min(free, accel_max * (1.0 - desired * desired))
    return min(max(free, -brake_max), accel_max)


@inner
def _leader(
    bodies: Floats, i: int, s: float, right: float, length: float, width: float, notices_m: float, notices_mps: float
) -> tuple[float, float]:
    """Return (gap [m], speed [m/s]) of the nearest of the surveyed `bodies` that is in the way of actor i.

    Bodies farther aside than `notices_m` or faster than `notices_mps` are ignored.
    """
    gap, speed = math.inf, 0.0
    for body in range(len(bodies)):
        ahead = bodies[body, c.S_ALONG] - s
        if ahead <= 0.0 or ahead > LOOK_AHEAD_M or body == i:
            continue
        if abs(bodies[body, c.S_RIGHT] - right) > min(0.5 * (width + bodies[body, c.S_WIDTH]) + 0.2, notices_m):
            continue
        if bodies[body, c.S_SPEED] > notices_mps:
            continue
        found = ahead - 0.5 * (length + bodies[body, c.S_LENGTH])
        if found < gap:
            gap, speed = found, bodies[body, c.S_SPEED]
    return gap, speed


@inner
def _wanted_speed(actor: Floats, whole: Ints, ego: Floats) -> float:
    """Return the target speed after leash (traffic stays near the ego) and chase (faster than the ego)."""
    target = actor[c.A_TARGET_V]
    if whole[c.I_LEASH] == 1:
        ahead = _ahead_of_ego(actor, ego)
        if abs(ahead) > LEASH_FREE_M:
            stretch = min((abs(ahead) - LEASH_FREE_M) / (LEASH_END_M - LEASH_FREE_M), 1.0)
            target *= 1.0 - stretch if ahead > 0.0 else 1.0 + stretch
    if whole[c.I_RELATIVE] == c.SPEED_ABOVE and whole[c.I_PHASE] >= c.PHASE_SCRIPT:
        target = ego[c.EGO_V] + actor[c.A_SCRIPT_V]
    return float(target)


@inner
def _ahead_of_ego(actor: Floats, ego: Floats) -> float:
    dx, dy = actor[c.A_X] - ego[c.EGO_X], actor[c.A_Y] - ego[c.EGO_Y]
    along, beside = cos_sin(ego[c.EGO_YAW])
    return float(dx * along + dy * beside)


@inner
def _abreast(actor: Floats, ego: Floats) -> float:
    """Return the acceleration that keeps an actor `A_SYNC_M` metres ahead of the ego [m/s2]."""
    behind = actor[c.A_SYNC_M] - _ahead_of_ego(actor, ego)
    wanted = ego[c.EGO_FORWARD] + 1.2 * (ego[c.EGO_V] - actor[c.A_V]) + 0.4 * behind
    return float(min(max(wanted, -actor[c.A_BRAKE_MAX]), actor[c.A_ACCEL_MAX]))


@inner
def _acceleration(world: WorldArrays, i: int) -> float:
    """Return the acceleration that the driver of actor i wants [m/s2]."""
    actor, whole = world.actors[i], world.actor_ints[i]
    if actor[c.A_SYNC_M] > 0.0:
        return _abreast(actor, world.ego)
    gap, leader_v = math.inf, 0.0
    if whole[c.I_SEES] != c.SEES_NOBODY:
        notices_m = notices_mps = math.inf
        if whole[c.I_SEES] == c.SEES_LATE:
            notices_m, notices_mps = NOTICED_LATE_M, NOTICED_SHARE * actor[c.A_TARGET_V]
        path, s, length = whole[c.I_PATH], actor[c.A_ALONG_M], actor[c.A_LENGTH]
        gap, leader_v = _leader(
            world.survey[path], i, s, actor[c.A_RIGHT_M], length, actor[c.A_WIDTH], notices_m, notices_mps
        )
        line = world.path_stop_line[path]
        if line >= 0 and whole[c.I_OBEYS_LIGHTS] == 1 and world.lights[line] in (_RED, _YELLOW):
            ahead = world.path_stop_m[path] - s - 0.5 * length
            if -0.5 < ahead < gap:
                gap, leader_v = max(ahead + IDM_GAP_M, 0.1), 0.0
    wanted = _wanted_speed(actor, whole, world.ego)
    asked = idm(actor[c.A_V], wanted, gap, leader_v, actor[c.A_ACCEL_MAX], actor[c.A_BRAKE_MAX])
    if whole[c.I_RELATIVE] == c.SPEED_SHARE and whole[c.I_PHASE] == c.PHASE_SCRIPT and actor[c.A_V] > wanted:
        # as CARLA's basic agent does: brake at once for a lower target speed
        asked = min(asked, max((wanted - actor[c.A_V]) / world.dt_s, -actor[c.A_BRAKE_MAX]))
    return float(asked)


@inner
def _move(world: WorldArrays, i: int) -> None:
    """Move one actor by one tick: along its path, sideways towards its target; set its lamps."""
    actor, whole, dt = world.actors[i], world.actor_ints[i], world.dt_s
    if whole[c.I_STUN] > 0:
        whole[c.I_STUN] -= 1
        actor[c.A_V], actor[c.A_ACCEL] = 0.0, 0.0
        return
    accel, walks = 0.0, whole[c.I_MODE] == c.MODE_WALK
    if walks:
        actor[c.A_V] = actor[c.A_TARGET_V]
    else:
        accel = _acceleration(world, i)
        actor[c.A_V] = max(0.0, actor[c.A_V] + accel * dt)
    actor[c.A_ACCEL] = accel
    actor[c.A_ALONG_M] += actor[c.A_V] * dt
    most = min(actor[c.A_LATERAL_MPS], SIDEWAYS_SHARE * actor[c.A_V]) * dt
    shift = min(max(actor[c.A_TARGET_RIGHT_M] - actor[c.A_RIGHT_M], -most), most)
    actor[c.A_RIGHT_M] += shift
    if actor[c.A_ALONG_M] >= actor[c.A_END_M]:
        actor[c.A_ALONG_M], actor[c.A_V], actor[c.A_TARGET_V] = actor[c.A_END_M], 0.0, 0.0
        if whole[c.I_AT_END] == c.AT_END_LEAVE:
            whole[c.I_ACTIVE] = c.ABSENT
    _show(actor, whole, accel, shift)
    x, y, yaw = path_pose(world, whole[c.I_PATH], actor[c.A_ALONG_M], actor[c.A_RIGHT_M])
    if shift != 0.0 and not walks:
        # a body that shifts sideways also turns its heading that way
        yaw += atan2(shift / dt, max(actor[c.A_V], 1.0))
    actor[c.A_X], actor[c.A_Y], actor[c.A_YAW] = x, y, yaw


@inner
def _show(actor: Floats, whole: Ints, accel: float, shift: float) -> None:
    """Set brake lamps, indicators, siren."""
    shown = whole[c.I_STATE] & _SIREN
    if accel < -0.6 or actor[c.A_V] < 0.1:
        shown |= _BRAKING
    if shift < 0.0:
        shown |= _LEFT
    elif shift > 0.0:
        shown |= _RIGHT
    whole[c.I_STATE] = shown


@inner
def move_actors(world: WorldArrays) -> None:
    """Move all actors in order: each actor's script first, then the actor if it exists and is not fixed."""
    for i in range(len(world.actors)):
        if world.actor_ints[i, c.I_PHASE] != c.PHASE_DONE:
            run_script(world, i)
        if world.actor_ints[i, c.I_ACTIVE] == c.PRESENT and world.actor_ints[i, c.I_MODE] != c.MODE_STATIC:
            _move(world, i)
