"""One tick of the world, compiled: lights, flows, actors, ego, contact.

Semantics are our own (highway-env's are not those of a judge): speed never becomes negative, gaps run from bumper to
bumper with real lengths, contact is the overlap of two boxes at the end of the tick, and it stops bodies instead of
moving them. Everything is a plain loop over `state.State`; the same inputs give the same bits.

It stays in one file on purpose: numba's cache notices changes of the file of a kernel only, not of its helpers'.
"""

from __future__ import annotations

import math

import numba
import numpy as np
from numpy.typing import NDArray

from pytest_drive_robust.domain.truth import ActorKind, ActorState, LightState
from pytest_drive_robust.simulators.embedded import state as c
from pytest_drive_robust.simulators.embedded.events import note
from pytest_drive_robust.simulators.embedded.state import State, Statics

__all__ = ["actor_rows", "advance", "fill_flows", "pose_actors"]

Floats = NDArray[np.float64]
_jit = numba.njit(cache=True)

# --- ego: a Lincoln MKZ sized car; kinematic bicycle, reference point in the middle of the wheelbase ---
WHEELBASE_M = 2.85
STEER_MAX_RAD = 0.61
STEER_RATE_RADPS = 0.9
STEER_LAG_S = 0.10
DRIVE_LAG_S = 0.20
BRAKE_LAG_S = 0.10
ACCEL_MAX_MPS2 = 5.0
POWER_WPKG = 55.0  # the engine's power per kilogram caps acceleration at speed
BRAKE_MAX_MPS2 = 8.0
GRIP_MPS2 = 7.5  # lateral acceleration beyond this is understeer

# --- IDM (Treiber, Hennecke, Helbing 2000) for the traffic ---
IDM_GAP_M = 2.0
IDM_HEADWAY_S = 1.1
IDM_COMFORT_MPS2 = 2.5
LOOK_AHEAD_M = 70.0
ON_PATH_M = 6.0
LEASH_FREE_M, LEASH_END_M = 30.0, 45.0

SIDEWAYS_SHARE = 0.5
DIRT_M = 2.0
STUN_TICKS = 40
SAME_ACTOR_S = 5.0
SAME_PLACE_M = 5.0
STANDING_MPS = 0.1

_PEDESTRIAN = int(ActorKind.PEDESTRIAN)
_CONE = int(ActorKind.CONE)
_SIGN = int(ActorKind.WARNING_SIGN)
_EMERGENCY = int(ActorKind.EMERGENCY)
_BUILDING = int(ActorKind.BUILDING)
_RED = int(LightState.RED)
_YELLOW = int(LightState.YELLOW)
_STOP_SIGN = int(LightState.STOP_SIGN)
_BRAKING = int(ActorState.BRAKING)
_LEFT = int(ActorState.INDICATOR_LEFT)
_RIGHT = int(ActorState.INDICATOR_RIGHT)
_SIREN = int(ActorState.SIREN)


@_jit
def path_pose(statics: Statics, path: int, s: float, lat: float) -> tuple[float, float, float]:
    """x, y, yaw of a point `s` metres along a path and `lat` metres to its right."""
    first, last = statics.path_start[path], statics.path_start[path + 1]
    share = s / statics.path_step[path]
    index = int(min(max(math.floor(share), 0.0), last - first - 2.0))
    share -= index
    k = first + index
    x = statics.paths[k, 0] + share * (statics.paths[k + 1, 0] - statics.paths[k, 0])
    y = statics.paths[k, 1] + share * (statics.paths[k + 1, 1] - statics.paths[k, 1])
    bounded = min(max(share, 0.0), 1.0)
    yaw = statics.paths[k, 2] + bounded * (statics.paths[k + 1, 2] - statics.paths[k, 2])
    return x - lat * math.sin(yaw), y + lat * math.cos(yaw), yaw


@_jit
def gap_along_path(
    statics: Statics, path: int, s: float, lat: float, length: float, width: float, x: float, y: float, other_length:
    float, other_width: float,
) -> float:  # fmt: skip
    """Bumper-to-bumper distance along the path to the body at (x, y), or infinity when it is not in the way."""
    first, last = statics.path_start[path], statics.path_start[path + 1]
    step = statics.path_step[path]
    stop = min(last, first + int((s + LOOK_AHEAD_M) / step))
    k = at = first + max(0, int(s / step) - 2)
    best = 1e18
    while k < stop:
        dx, dy = x - statics.paths[k, 0], y - statics.paths[k, 1]
        d = dx * dx + dy * dy
        if d < best:
            best, at = d, k
        # the body cannot come nearer than ON_PATH_M before the path has gone the rest of the way towards it
        k += 2 if d < 100.0 else max(2, int((math.sqrt(d) - ON_PATH_M) / step))
    if best > ON_PATH_M * ON_PATH_M:
        return math.inf
    yaw = statics.paths[at, 2]
    dx, dy = x - statics.paths[at, 0], y - statics.paths[at, 1]
    beside = -dx * math.sin(yaw) + dy * math.cos(yaw)
    if abs(beside - lat) > (width + other_width) / 2.0 + 0.2:
        return math.inf
    ahead = (at - first) * step + dx * math.cos(yaw) + dy * math.sin(yaw) - s
    if ahead <= 0.0:
        return math.inf
    return float(ahead - (length + other_length) / 2.0)


@_jit
def idm(v: float, target: float, gap: float, leader_v: float, accel_max: float, brake_max: float) -> float:
    """Acceleration of the intelligent driver model, limited to what the actor can do [m/s2]."""
    if target < 0.05:
        free = -brake_max if v > 0.0 else 0.0
    elif v > target:
        free = -IDM_COMFORT_MPS2 * min(1.0, v / target - 1.0 + 0.2)
    else:
        free = accel_max * (1.0 - (v / target) ** 4)
    if gap < 1e17:
        closing = v * (v - leader_v) / (2.0 * math.sqrt(accel_max * IDM_COMFORT_MPS2))
        desired = IDM_GAP_M + max(0.0, v * IDM_HEADWAY_S + closing)
        free = min(free, accel_max * (1.0 - (desired / max(gap, 0.1)) ** 2))
    return min(max(free, -brake_max), accel_max)


@_jit
def _nearest_leader(statics: Statics, state: State, i: int) -> tuple[float, float]:
    """(gap, speed) of the first body in the way of actor i: other actors, the ego, a red light."""
    actor, whole = state.actors[i], state.actor_ints[i]
    path = whole[c.I_PATH]
    ch, sh = math.cos(actor[c.A_YAW]), math.sin(actor[c.A_YAW])
    gap, speed = math.inf, 0.0
    for j in range(-1, len(state.actors)):
        if j == i:
            continue
        if j < 0:
            x, y, v = state.ego[c.EGO_X], state.ego[c.EGO_Y], state.ego[c.EGO_V]
            yaw, length, width = state.ego[c.EGO_YAW], statics.ego_length_m, statics.ego_width_m
        else:
            other = state.actors[j]
            if state.actor_ints[j, c.I_ACTIVE] != 1 or state.actor_ints[j, c.I_SOLID] == 0:
                continue
            x, y, v = other[c.A_X], other[c.A_Y], other[c.A_V]
            yaw, length, width = other[c.A_YAW], other[c.A_LENGTH], other[c.A_WIDTH]
        dx, dy = x - actor[c.A_X], y - actor[c.A_Y]
        if dx * dx + dy * dy > LOOK_AHEAD_M * LOOK_AHEAD_M or dx * ch + dy * sh < -6.0:
            continue
        turn = yaw - actor[c.A_YAW]
        ct, st = abs(math.cos(turn)), abs(math.sin(turn))
        long, wide = ct * length + st * width, ct * width + st * length
        if j >= 0 and state.actor_ints[j, c.I_PATH] == path:
            found = math.inf
            ahead = state.actors[j, c.A_S] - actor[c.A_S]
            if ahead > 0.0 and abs(state.actors[j, c.A_LAT] - actor[c.A_LAT]) <= (actor[c.A_WIDTH] + wide) / 2.0 + 0.2:
                found = ahead - (actor[c.A_LENGTH] + long) / 2.0
        else:
            found = gap_along_path(
                statics, path, actor[c.A_S], actor[c.A_LAT], actor[c.A_LENGTH], actor[c.A_WIDTH], x, y, long, wide
            )
        if found < gap:
            gap, speed = found, max(0.0, v * math.cos(turn))
    line = statics.path_stop_line[path]
    if line >= 0 and whole[c.I_OBEYS_LIGHTS] == 1:
        ahead = statics.path_stop_s[path] - actor[c.A_S] - actor[c.A_LENGTH] / 2.0
        light = state.lights[line]
        if light in (_RED, _YELLOW) and -0.5 < ahead < gap:
            gap, speed = max(ahead + IDM_GAP_M, 0.1), 0.0
    return gap, speed


@_jit
def _fires(statics: Statics, state: State, i: int) -> bool:
    """Has the trigger of actor i come? Only after the scenario woke up."""
    if state.clock[1] < 0:
        return False
    actor = state.actors[i]
    kind = state.actor_ints[i, c.I_TRIGGER]
    if kind == c.TRIGGER_PROGRESS:
        return bool(statics.route_s[state.criteria_ints[c.CI_PROGRESS]] >= actor[c.A_TRIGGER_PROGRESS_M])
    if kind == c.TRIGGER_ARRIVAL:
        away = math.hypot(state.ego[c.EGO_X] - actor[c.A_TRIGGER_X], state.ego[c.EGO_Y] - actor[c.A_TRIGGER_Y])
        v = state.ego[c.EGO_V]
        return bool(away < actor[c.A_TRIGGER_M] or (v > 0.5 and away / v < actor[c.A_TRIGGER_TTA_S]))
    return True


@_jit
def _run_script(statics: Statics, state: State, i: int) -> None:
    """Waiting -> delayed -> script -> done: what a trigger sets off."""
    actor, whole = state.actors[i], state.actor_ints[i]
    phase = whole[c.I_PHASE]
    if phase == c.PHASE_WAITING and _fires(statics, state, i):
        phase, actor[c.A_TIMER_S] = c.PHASE_DELAYED, actor[c.A_DELAY_S]
    if phase == c.PHASE_DELAYED:
        actor[c.A_TIMER_S] -= statics.dt_s
        if actor[c.A_TIMER_S] <= 0.0:
            phase, actor[c.A_TIMER_S] = c.PHASE_SCRIPT, actor[c.A_SCRIPT_S]
            if whole[c.I_ACTIVE] == 2:
                whole[c.I_ACTIVE] = 1
                actor[c.A_V] = 0.0 if whole[c.I_MODE] == c.MODE_STATIC else state.ego[c.EGO_V]
            scale = state.ego[c.EGO_V] if whole[c.I_RELATIVE] == 1 else 1.0
            actor[c.A_TARGET_V] = actor[c.A_SCRIPT_V] * scale
            actor[c.A_TARGET_LAT] = actor[c.A_SCRIPT_LAT]
            actor[c.A_SYNC_M] = 0.0
    elif phase == c.PHASE_SCRIPT:
        actor[c.A_TIMER_S] -= statics.dt_s
        if actor[c.A_TIMER_S] <= 0.0:
            phase = c.PHASE_DONE
            actor[c.A_TARGET_V] = actor[c.A_AFTER_V]
    whole[c.I_PHASE] = phase


@_jit
def _wanted_speed(state: State, i: int) -> float:
    """The target speed after leash (traffic stays near the ego) and chase (faster than the ego)."""
    actor, whole, ego = state.actors[i], state.actor_ints[i], state.ego
    target = actor[c.A_TARGET_V]
    dx, dy = actor[c.A_X] - ego[c.EGO_X], actor[c.A_Y] - ego[c.EGO_Y]
    ahead = dx * math.cos(ego[c.EGO_YAW]) + dy * math.sin(ego[c.EGO_YAW])
    if whole[c.I_LEASH] == 1 and abs(ahead) > LEASH_FREE_M:
        stretch = min((abs(ahead) - LEASH_FREE_M) / (LEASH_END_M - LEASH_FREE_M), 1.0)
        target *= 1.0 - stretch if ahead > 0.0 else 1.0 + stretch
    if whole[c.I_RELATIVE] == 2 and whole[c.I_PHASE] >= c.PHASE_SCRIPT:
        target = ego[c.EGO_V] + actor[c.A_SCRIPT_V]
    return float(target)


@_jit
def _abreast(state: State, i: int) -> float:
    """Acceleration that keeps actor i `A_SYNC_M` metres ahead of the ego [m/s2]."""
    actor, ego = state.actors[i], state.ego
    dx, dy = actor[c.A_X] - ego[c.EGO_X], actor[c.A_Y] - ego[c.EGO_Y]
    ahead = dx * math.cos(ego[c.EGO_YAW]) + dy * math.sin(ego[c.EGO_YAW])
    wanted = ego[c.EGO_FORWARD] + 1.2 * (ego[c.EGO_V] - actor[c.A_V]) + 0.4 * (actor[c.A_SYNC_M] - ahead)
    return float(min(max(wanted, -actor[c.A_BRAKE_MAX]), actor[c.A_ACCEL_MAX]))


@_jit
def _move_actor(statics: Statics, state: State, i: int) -> None:
    actor, whole, dt = state.actors[i], state.actor_ints[i], statics.dt_s
    _run_script(statics, state, i)
    if whole[c.I_ACTIVE] != 1 or whole[c.I_MODE] == c.MODE_STATIC:
        return
    if whole[c.I_STUN] > 0:
        whole[c.I_STUN] -= 1
        actor[c.A_V], actor[c.A_ACCEL] = 0.0, 0.0
        return
    if whole[c.I_MODE] == c.MODE_WALK:
        actor[c.A_V] = actor[c.A_TARGET_V]
        accel = 0.0
    else:
        if actor[c.A_SYNC_M] > 0.0:
            accel = _abreast(state, i)
        elif whole[c.I_BLIND] == 1:
            wanted = _wanted_speed(state, i)
            accel = idm(actor[c.A_V], wanted, math.inf, 0.0, actor[c.A_ACCEL_MAX], actor[c.A_BRAKE_MAX])
        else:
            gap, leader_v = _nearest_leader(statics, state, i)
            wanted = _wanted_speed(state, i)
            accel = idm(actor[c.A_V], wanted, gap, leader_v, actor[c.A_ACCEL_MAX], actor[c.A_BRAKE_MAX])
        actor[c.A_V] = max(0.0, actor[c.A_V] + accel * dt)
    actor[c.A_ACCEL] = accel
    actor[c.A_S] += actor[c.A_V] * dt
    away = actor[c.A_TARGET_LAT] - actor[c.A_LAT]
    # a car moves sideways only as fast as it drives forward
    rate = min(actor[c.A_LAT_RATE], SIDEWAYS_SHARE * actor[c.A_V])
    shift = min(max(away, -rate * dt), rate * dt)
    actor[c.A_LAT] += shift
    if actor[c.A_S] >= actor[c.A_END_S]:
        actor[c.A_S], actor[c.A_V], actor[c.A_TARGET_V] = actor[c.A_END_S], 0.0, 0.0
        if whole[c.I_AT_END] == c.AT_END_LEAVE:
            whole[c.I_ACTIVE] = 0
    _show(state, i, accel, shift)
    x, y, yaw = path_pose(statics, whole[c.I_PATH], actor[c.A_S], actor[c.A_LAT])
    # a body that shifts sideways also turns its nose that way
    slip = math.atan2(shift / dt, max(actor[c.A_V], 1.0)) if whole[c.I_MODE] == c.MODE_DRIVE else 0.0
    actor[c.A_X], actor[c.A_Y], actor[c.A_YAW] = x, y, yaw + slip


@_jit
def _show(state: State, i: int, accel: float, shift: float) -> None:
    """Brake lamps, indicators, siren."""
    whole = state.actor_ints[i]
    shown = whole[c.I_STATE] & _SIREN
    if accel < -0.6 or state.actors[i, c.A_V] < 0.1:
        shown |= _BRAKING
    if shift < 0.0:
        shown |= _LEFT
    elif shift > 0.0:
        shown |= _RIGHT
    whole[c.I_STATE] = shown


@_jit
def _run_flows(statics: Statics, state: State) -> None:
    """A source sends the next car once the last one is farther away than the drawn gap."""
    for f in range(len(state.flows)):
        flow, whole = state.flows[f], state.flow_ints[f]
        latest = whole[c.FI_LATEST]
        on_road = latest >= 0 and state.actor_ints[latest, c.I_ACTIVE] == 1
        if on_road and state.actors[latest, c.A_S] - flow[c.F_SOURCE_S] < flow[c.F_NEXT_GAP_M]:
            continue
        slot = -1
        for k in range(whole[c.FI_FIRST_SLOT], whole[c.FI_LAST_SLOT]):
            if state.actor_ints[k, c.I_ACTIVE] == 0:
                slot = k
                break
        if slot < 0:
            continue
        _spawn(statics, state, f, slot, flow[c.F_SOURCE_S])


@_jit
def _spawn(statics: Statics, state: State, f: int, slot: int, s: float) -> None:
    flow, whole = state.flows[f], state.flow_ints[f]
    actor = state.actors[slot]
    lat = flow[c.F_LAT]
    actor[c.A_S], actor[c.A_LAT], actor[c.A_V], actor[c.A_ACCEL] = s, lat, flow[c.F_SPEED], 0.0
    actor[c.A_TARGET_V], actor[c.A_TARGET_LAT], actor[c.A_END_S] = flow[c.F_SPEED], lat, flow[c.F_SINK_S]
    actor[c.A_X], actor[c.A_Y], actor[c.A_YAW] = path_pose(statics, whole[c.FI_PATH], s, lat)
    state.actor_ints[slot, c.I_ACTIVE] = 1
    state.actor_ints[slot, c.I_STUN] = 0
    state.actor_ints[slot, c.I_LAST_HIT] = -100000
    whole[c.FI_LATEST] = slot
    flow[c.F_NEXT_GAP_M] = statics.flow_gaps[f, whole[c.FI_DRAWN] % statics.flow_gaps.shape[1]]
    whole[c.FI_DRAWN] += 1


@_jit
def fill_flows(statics: Statics, state: State) -> None:
    """At the start every flow is already on the road, from its sink back to its source."""
    for f in range(len(state.flows)):
        flow, whole = state.flows[f], state.flow_ints[f]
        s = flow[c.F_SINK_S] - 5.0
        for slot in range(whole[c.FI_FIRST_SLOT], whole[c.FI_LAST_SLOT]):
            if s < flow[c.F_SOURCE_S]:
                break
            _spawn(statics, state, f, slot, s)
            s -= flow[c.F_NEXT_GAP_M]


@_jit
def _set_lights(statics: Statics, state: State) -> None:
    since = -1.0 if state.clock[1] < 0 else (state.clock[0] - state.clock[1]) * statics.dt_s
    for k in range(len(state.lights)):
        if statics.stop_is_light[k] == 0:
            state.lights[k] = _STOP_SIGN
        elif since < 0.0:
            state.lights[k] = statics.light_before[k]
        else:
            phases = statics.light_until_s.shape[1]
            phase = 0
            while phase < phases - 1 and since >= statics.light_until_s[k, phase]:
                phase += 1
            state.lights[k] = statics.light_states[k, phase]


@_jit
def _on_dirt(statics: Statics, state: State, throttle: float, steer: float) -> tuple[float, float]:
    """Dirt within `DIRT_M` of the ego disturbs its controls."""
    for k in range(len(statics.patches)):
        dx, dy = statics.patches[k, 0] - state.ego[c.EGO_X], statics.patches[k, 1] - state.ego[c.EGO_Y]
        if dx * dx + dy * dy < DIRT_M * DIRT_M:
            noise = statics.patch_noise[state.clock[0] % len(statics.patch_noise)]
            throttle = min(max(throttle + noise[0], 0.0), 1.0)
            steer = min(max(steer + noise[1], -1.0), 1.0)
            break
    return throttle, steer


@_jit
def _move_ego(statics: Statics, ego: Floats, throttle: float, steer: float, brake: float) -> None:
    """Kinematic bicycle with steering rate and lag, engine power, drag, brake lag; v >= 0."""
    dt, v = statics.dt_s, ego[c.EGO_V]
    wanted = steer * STEER_MAX_RAD - ego[c.EGO_STEER]
    turn = wanted * (1.0 - math.exp(-dt / STEER_LAG_S))
    ego[c.EGO_STEER] += min(max(turn, -STEER_RATE_RADPS * dt), STEER_RATE_RADPS * dt)
    push = throttle * min(ACCEL_MAX_MPS2, POWER_WPKG / max(v, 1.0)) if brake <= 0.0 else 0.0
    drag = 0.12 + 0.018 * v + 0.0006 * v * v
    command = push - brake * BRAKE_MAX_MPS2
    lag = BRAKE_LAG_S if command < ego[c.EGO_ACCEL] else DRIVE_LAG_S
    ego[c.EGO_ACCEL] += (command - ego[c.EGO_ACCEL]) * (1.0 - math.exp(-dt / lag))
    moving = drag if v > 0.0 or ego[c.EGO_ACCEL] > drag else max(ego[c.EGO_ACCEL], 0.0)
    after = max(0.0, v + (ego[c.EGO_ACCEL] - moving) * dt)
    slip = math.atan(0.5 * math.tan(ego[c.EGO_STEER]))
    mean = 0.5 * (v + after)
    yaw_rate = mean * math.cos(slip) * math.tan(ego[c.EGO_STEER]) / WHEELBASE_M
    if abs(yaw_rate) * mean > GRIP_MPS2:
        yaw_rate = math.copysign(GRIP_MPS2 / mean, yaw_rate)
        slip = 0.0
    direction = ego[c.EGO_YAW] + slip + 0.5 * yaw_rate * dt
    ego[c.EGO_X] += mean * math.cos(direction) * dt
    ego[c.EGO_Y] += mean * math.sin(direction) * dt
    yaw = ego[c.EGO_YAW] + yaw_rate * dt
    ego[c.EGO_YAW] = yaw - 2.0 * math.pi * math.floor(yaw / (2.0 * math.pi) + 0.5)
    ego[c.EGO_FORWARD], ego[c.EGO_RIGHT], ego[c.EGO_YAW_RATE] = (after - v) / dt, mean * yaw_rate, yaw_rate
    ego[c.EGO_V] = after


@_jit
def overlap(
    x: float, y: float, yaw: float, length: float, width: float, ox: float, oy: float, oyaw: float, olength: float,
    owidth: float,
) -> tuple[float, float, float]:  # fmt: skip
    """Separating axes of two boxes: (depth, nx, ny); depth <= 0 means no contact, n pushes the first box out."""
    dx, dy = x - ox, y - oy
    best, bx, by = 1e18, 0.0, 0.0
    for axis in range(4):
        angle = (yaw if axis < 2 else oyaw) + (axis % 2) * math.pi / 2.0
        ax, ay = math.cos(angle), math.sin(angle)
        mine = 0.5 * (abs(math.cos(angle - yaw)) * length + abs(math.sin(angle - yaw)) * width)
        theirs = 0.5 * (abs(math.cos(angle - oyaw)) * olength + abs(math.sin(angle - oyaw)) * owidth)
        distance = dx * ax + dy * ay
        depth = mine + theirs - abs(distance)
        if depth <= 0.0:
            return 0.0, 0.0, 0.0
        if depth < best:
            sign = 1.0 if distance >= 0.0 else -1.0
            best, bx, by = depth, sign * ax, sign * ay
    return best, bx, by


@_jit
def _touch(statics: Statics, state: State, nx: float, ny: float, depth: float, i: int) -> None:
    """Contact: at most one event per 5 s and actor, per 5 m of road, and none while standing; the ego is pushed out."""
    ego, criteria = state.ego, state.criteria
    v = ego[c.EGO_V]
    near = math.hypot(ego[c.EGO_X] - criteria[c.C_LAST_HIT_X], ego[c.EGO_Y] - criteria[c.C_LAST_HIT_Y]) < SAME_PLACE_M
    again = i >= 0 and (state.clock[0] - state.actor_ints[i, c.I_LAST_HIT]) * statics.dt_s < SAME_ACTOR_S
    if not near and not again and v >= STANDING_MPS:
        note(state, c.EVENT_COLLISION, float(i), v)
        criteria[c.C_LAST_HIT_X], criteria[c.C_LAST_HIT_Y] = ego[c.EGO_X], ego[c.EGO_Y]
        if i >= 0:
            state.actor_ints[i, c.I_LAST_HIT] = state.clock[0]
    if i >= 0:
        kind = state.actor_ints[i, c.I_KIND]
        state.actor_ints[i, c.I_STUN] = STUN_TICKS
        if kind in (_PEDESTRIAN, _CONE, _SIGN):
            state.actor_ints[i, c.I_SOLID] = 0
            state.actor_ints[i, c.I_MODE] = c.MODE_STATIC
            state.actors[i, c.A_HEIGHT] = 0.3
            state.actors[i, c.A_V] = 0.0
            ego[c.EGO_V] *= 0.8
            return
    ego[c.EGO_X] += nx * depth
    ego[c.EGO_Y] += ny * depth
    against = nx * math.cos(ego[c.EGO_YAW]) + ny * math.sin(ego[c.EGO_YAW])
    if against < 0.0:
        ego[c.EGO_V] = max(0.0, v * (1.0 + against))
        ego[c.EGO_ACCEL] = min(ego[c.EGO_ACCEL], 0.0)


@_jit
def _contacts(statics: Statics, state: State) -> None:
    ego = state.ego
    length, width = statics.ego_length_m, statics.ego_width_m
    for i in range(len(state.actors)):
        if state.actor_ints[i, c.I_ACTIVE] != 1 or state.actor_ints[i, c.I_SOLID] == 0:
            continue
        other = state.actors[i]
        reach = 0.5 * (length + width + other[c.A_LENGTH] + other[c.A_WIDTH])
        if abs(other[c.A_X] - ego[c.EGO_X]) > reach or abs(other[c.A_Y] - ego[c.EGO_Y]) > reach:
            continue
        depth, nx, ny = overlap(
            ego[c.EGO_X], ego[c.EGO_Y], ego[c.EGO_YAW], length, width,
            other[c.A_X], other[c.A_Y], other[c.A_YAW], other[c.A_LENGTH], other[c.A_WIDTH],
        )  # fmt: skip
        if depth > 0.0:
            _touch(statics, state, nx, ny, depth, i)
    for k in range(len(statics.buildings)):
        box = statics.buildings[k]
        reach = 0.5 * (length + box[3] + box[4])
        if abs(box[0] - ego[c.EGO_X]) > reach or abs(box[1] - ego[c.EGO_Y]) > reach:
            continue
        depth, nx, ny = overlap(
            ego[c.EGO_X], ego[c.EGO_Y], ego[c.EGO_YAW], length, width, box[0], box[1], box[2], box[3], box[4]
        )
        if depth > 0.0:
            _touch(statics, state, nx, ny, depth, -1)


@_jit
def advance(statics: Statics, state: State, throttle: float, steer: float, brake: float) -> None:
    """One tick: time, lights, traffic, ego, contact. Criteria follow in `criteria.judge`."""
    state.clock[0] += 1
    _set_lights(statics, state)
    _run_flows(statics, state)
    for i in range(len(state.actors)):
        _move_actor(statics, state, i)
    throttle, steer = _on_dirt(statics, state, throttle, steer)
    _move_ego(statics, state.ego, throttle, steer, brake)
    _contacts(statics, state)


@_jit
def pose_actors(statics: Statics, state: State) -> None:
    """Put every actor where its path coordinates say; once, after the world was built."""
    _set_lights(statics, state)
    for i in range(len(state.actors)):
        whole, actor = state.actor_ints[i], state.actors[i]
        if whole[c.I_PATH] >= 0:
            x, y, yaw = path_pose(statics, whole[c.I_PATH], actor[c.A_S], actor[c.A_LAT])
            actor[c.A_X], actor[c.A_Y], actor[c.A_YAW] = x, y, yaw + actor[c.A_TURNED]


@_jit
def actor_rows(state: State, rows: Floats) -> int:
    """Write the actors that exist now into `rows` (columns of `Frame.actors`); the number of rows written."""
    count = 0
    for i in range(len(state.actors)):
        if state.actor_ints[i, c.I_ACTIVE] != 1:
            continue
        actor, row = state.actors[i], rows[count]
        row[0], row[1] = i, state.actor_ints[i, c.I_KIND]
        row[2], row[3], row[4], row[5] = actor[c.A_X], actor[c.A_Y], actor[c.A_YAW], actor[c.A_V]
        row[6], row[7], row[8] = actor[c.A_LENGTH], actor[c.A_WIDTH], actor[c.A_HEIGHT]
        row[9] = state.actor_ints[i, c.I_STATE]
        count += 1
    return count
