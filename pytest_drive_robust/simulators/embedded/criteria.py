"""The leaderboard's criteria and ends of an episode, one compiled pass per tick.

Source: Bench2Drive `scenario_runner/srunner/scenariomanager/scenarioatomics/atomic_criteria.py` and
`leaderboard/leaderboard/scenarios/scenario_manager.py`; the constants are theirs. Collisions are noted by
`kernels.contacts`, where the contact happens.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from pytest_drive_robust.domain.truth import LightState
from pytest_drive_robust.simulators.embedded import state as c
from pytest_drive_robust.simulators.embedded.events import note
from pytest_drive_robust.simulators.embedded.jit import inner
from pytest_drive_robust.simulators.embedded.state import State, Statics

__all__ = ["finish", "judge", "nearest_lane"]

ROUTE_WINDOW = 3  # the current waypoint and the next two
COMPLETE_PCT = 99.0
COMPLETE_M = 10.0
OUTSIDE_M = 0.5
WRONG_WAY_AFTER_JUNCTION_RAD = math.radians(120.0)
WRONG_WAY_JUMP_RAD = math.radians(150.0)
DEVIATION_M = 30.0
DEVIATION_SOFT_M = 15.0
DEVIATION_SHARE = 0.30
BLOCKED_S = 60.0
STANDING_MPS = 0.1
LIGHT_RADIUS_M = 15.0
STOP_RADIUS_M = 4.0
CHECKPOINTS = 20
TRIGGER_RADIUS_M = 2.0
YIELD_NEAR_M = 50.0
YIELD_S = 10.0
_HAIR_M = 1e-6

_RED = int(LightState.RED)


@inner
def _between(angle: float, other: float) -> float:
    """Return the unsigned difference of two angles, 0..pi."""
    turn = angle - other
    return abs(turn - 2.0 * math.pi * math.floor(turn / (2.0 * math.pi) + 0.5))


@inner
def _nearest_point(statics: Statics, lane: int, x: float, y: float, best: float, at: int) -> tuple[float, int]:
    """(`best`, `at`), or distance and row of the first point of the usable lane that is nearer than `best` and all."""
    k, end = statics.lane_start[lane], statics.lane_start[lane + 1]
    while k < end:
        dx, dy = x - statics.lanes[k, 0], y - statics.lanes[k, 1]
        d = math.sqrt(dx * dx + dy * dy)
        if d < best:
            best, at = d, k
        # no point can be nearer than `best` before the lane has gone the difference
        k += max(1, int((d - best) / statics.lane_step_m))
    return best, at


@inner
def nearest_lane(statics: Statics, x: float, y: float, last: int) -> tuple[int, float, float]:
    """Return (lane, distance to its centre line [m], heading there) of the nearest driving or parking lane.

    `last` is a lane that may well be near, or -1: it changes nothing but how many points are looked at.
    """
    best, at = 1e18, 0
    for lane in range(len(statics.lane_start) - 1):
        if statics.lane_of[statics.lane_start[lane]] == last:
            best, at = _nearest_point(statics, lane, x, y, best, at)
            best += _HAIR_M  # of points that are equally near the first one counts
            break
    for lane in range(len(statics.lane_start) - 1):
        best, at = _nearest_point(statics, lane, x, y, best, at)
    heading = statics.lanes[at, 2]
    dx, dy = x - statics.lanes[at, 0], y - statics.lanes[at, 1]
    along = dx * math.cos(heading) + dy * math.sin(heading)
    beside = abs(-dx * math.sin(heading) + dy * math.cos(heading))
    if abs(along) > 1.0:  # beyond the end of the lane
        beside = math.hypot(beside, abs(along))
    return statics.lane_of[at], beside, heading


@inner
def _progress(statics: Statics, state: State) -> float:
    """Pass waypoints; returns the metres gained in this tick."""
    ints, ego = state.criteria_ints, state.ego
    before = ints[c.CI_PROGRESS]
    reached = before
    for k in range(before, min(before + ROUTE_WINDOW, len(statics.route))):
        yaw = statics.route[k, 2]
        dx, dy = ego[c.EGO_X] - statics.route[k, 0], ego[c.EGO_Y] - statics.route[k, 1]
        if dx * math.cos(yaw) + dy * math.sin(yaw) > 0.0:
            reached = k
    ints[c.CI_PROGRESS] = reached
    return float(statics.route_s[reached] - statics.route_s[before])


@inner
def _wake_scenario(statics: Statics, state: State) -> None:
    s = statics.route_s[state.criteria_ints[c.CI_PROGRESS]]
    if state.clock[1] < 0 and s >= statics.trigger_m - TRIGGER_RADIUS_M:
        state.clock[1] = state.clock[0]
    if state.clock[1] >= 0 and s >= statics.scenario_end_m:
        state.criteria_ints[c.CI_SCENARIO_OVER] = 1


@inner
def _scenario_runs(state: State) -> bool:
    return bool(state.clock[1] >= 0 and state.criteria_ints[c.CI_SCENARIO_OVER] == 0)


@inner
def _lane_keeping(statics: Statics, state: State, gained: float) -> None:
    """Count the metres of route that are passed outside lanes or against the traffic."""
    ego, ints = state.ego, state.criteria_ints
    last = ints[c.CI_LAST_LANE]
    lane, beside, heading = nearest_lane(statics, ego[c.EGO_X], ego[c.EGO_Y], last)
    outside = beside > statics.lane_width[lane] / 2.0 + OUTSIDE_M
    if statics.lane_junction[lane] == 1:
        ints[c.CI_WRONG_WAY] = 0
    elif last >= 0 and lane != last:
        if statics.lane_junction[last] == 1:
            ints[c.CI_WRONG_WAY] = 1 if _between(ego[c.EGO_YAW], heading) >= WRONG_WAY_AFTER_JUNCTION_RAD else 0
        else:
            _, _, before = nearest_lane_heading(statics, last, ego[c.EGO_X], ego[c.EGO_Y])
            if _between(before, heading) > WRONG_WAY_JUMP_RAD:
                ints[c.CI_WRONG_WAY] = 1 - ints[c.CI_WRONG_WAY]
    ints[c.CI_LAST_LANE] = lane
    allowed = statics.two_ways == 1 and _scenario_runs(state)
    if outside or (ints[c.CI_WRONG_WAY] == 1 and not allowed):
        state.criteria[c.C_OUTSIDE_M] += gained


@inner
def nearest_lane_heading(statics: Statics, lane: int, x: float, y: float) -> tuple[float, float, float]:
    """Return (x, y, heading) of the centre point of one lane that is nearest to (x, y)."""
    best, at = 1e18, 0
    for k in range(len(statics.lanes)):
        if statics.lane_of[k] != lane:
            continue
        dx, dy = x - statics.lanes[k, 0], y - statics.lanes[k, 1]
        d = dx * dx + dy * dy
        if d < best:
            best, at = d, k
    return statics.lanes[at, 0], statics.lanes[at, 1], statics.lanes[at, 2]


@inner
def _crosses(ax: float, ay: float, bx: float, by: float, px: float, py: float, qx: float, qy: float) -> bool:
    """Return whether the segments a-b and p-q cross."""
    d1 = (bx - ax) * (py - ay) - (by - ay) * (px - ax)
    d2 = (bx - ax) * (qy - ay) - (by - ay) * (qx - ax)
    d3 = (qx - px) * (ay - py) - (qy - py) * (ax - px)
    d4 = (qx - px) * (by - py) - (qy - py) * (bx - px)
    return d1 * d2 < 0.0 and d3 * d4 < 0.0


@inner
def _red_lights(statics: Statics, state: State) -> None:
    """Note when the tail of the ego crosses the stop line of a red light, heading with it."""
    ego = state.ego
    half = statics.ego_length_m / 2.0
    ch, sh = math.cos(ego[c.EGO_YAW]), math.sin(ego[c.EGO_YAW])
    ax, ay = ego[c.EGO_X] - 0.8 * half * ch, ego[c.EGO_Y] - 0.8 * half * sh
    bx, by = ego[c.EGO_X] - (half + 1.0) * ch, ego[c.EGO_Y] - (half + 1.0) * sh
    for k in range(len(statics.stop_lines)):
        if statics.stop_is_light[k] == 0 or state.lights[k] != _RED or state.criteria_ints[c.CI_LAST_LIGHT] == k:
            continue
        x, y, heading, width = statics.stop_lines[k]
        if math.hypot(x - ego[c.EGO_X], y - ego[c.EGO_Y]) > LIGHT_RADIUS_M or math.cos(heading - ego[c.EGO_YAW]) < 0.2:
            continue
        rx, ry = -math.sin(heading) * 0.6 * width, math.cos(heading) * 0.6 * width
        if _crosses(ax, ay, bx, by, x - rx, y - ry, x + rx, y + ry):
            state.criteria_ints[c.CI_LAST_LIGHT] = k
            note(state, c.EVENT_RED_LIGHT, float(k), 0.0)


@inner
def _stop_signs(statics: Statics, state: State) -> None:
    """Note when the ego leaves a stop sign without having come to rest."""
    ego, ints = state.ego, state.criteria_ints
    current = ints[c.CI_STOP_LINE]
    front = statics.ego_length_m / 2.0
    fx, fy = ego[c.EGO_X] + front * math.cos(ego[c.EGO_YAW]), ego[c.EGO_Y] + front * math.sin(ego[c.EGO_YAW])
    if current < 0:
        for k in range(len(statics.stop_lines)):
            x, y, heading, _ = statics.stop_lines[k]
            near = math.hypot(x - fx, y - fy) < STOP_RADIUS_M
            if statics.stop_is_light[k] == 0 and near and math.cos(heading - ego[c.EGO_YAW]) > 0.5:
                ints[c.CI_STOP_LINE], ints[c.CI_STOPPED] = k, 0
                current = k
                break
    if current < 0:
        return
    if ego[c.EGO_V] < STANDING_MPS:
        ints[c.CI_STOPPED] = 1
    x, y, heading, _ = statics.stop_lines[current]
    beyond = (ego[c.EGO_X] - x) * math.cos(heading) + (ego[c.EGO_Y] - y) * math.sin(heading)
    away = math.hypot(x - ego[c.EGO_X], y - ego[c.EGO_Y])
    if beyond > front and away > STOP_RADIUS_M:
        if ints[c.CI_STOPPED] == 0:
            note(state, c.EVENT_STOP_SIGN, float(current), ego[c.EGO_V])
        ints[c.CI_STOP_LINE] = -1


@inner
def _speed(statics: Statics, state: State) -> None:
    """Compare the ego's mean speed with that of the background traffic, per twentieth of the route: the efficiency."""
    criteria, ints = state.criteria, state.criteria_ints
    total, count = 0.0, 0
    for i in range(len(state.actors)):
        if state.actor_ints[i, c.I_BACKGROUND] == 1 and state.actor_ints[i, c.I_ACTIVE] == 1:
            total += state.actors[i, c.A_V]
            count += 1
    if count > 0:
        criteria[c.C_EGO_SUM] += state.ego[c.EGO_V]
        criteria[c.C_TRAFFIC_SUM] += total / count
        ints[c.CI_SAMPLES] += 1
    s = statics.route_s[ints[c.CI_PROGRESS]]
    if s - criteria[c.C_CHECKPOINT_M] > statics.route_s[-1] / CHECKPOINTS:
        criteria[c.C_CHECKPOINT_M] = s
        _speed_event(state)


@inner
def _speed_event(state: State) -> None:
    criteria, ints = state.criteria, state.criteria_ints
    ratio = 100.0
    if ints[c.CI_SAMPLES] > 0 and criteria[c.C_TRAFFIC_SUM] > 0.0:
        ratio = round(100.0 * criteria[c.C_EGO_SUM] / criteria[c.C_TRAFFIC_SUM], 2)
    note(state, c.EVENT_SPEED, -1.0, ratio)
    criteria[c.C_EGO_SUM], criteria[c.C_TRAFFIC_SUM] = 0.0, 0.0
    ints[c.CI_SAMPLES] = 0


@inner
def _yield_test(statics: Statics, state: State) -> None:
    """Note when the emergency vehicle is not ahead of the ego ten seconds after it came within 50 m."""
    e = statics.emergency_actor
    if e < 0 or state.actor_ints[e, c.I_ACTIVE] != 1 or state.criteria_ints[c.CI_YIELD_SEEN] == 2:
        return
    dx, dy = state.actors[e, c.A_X] - state.ego[c.EGO_X], state.actors[e, c.A_Y] - state.ego[c.EGO_Y]
    if math.hypot(dx, dy) < YIELD_NEAR_M:
        state.criteria_ints[c.CI_YIELD_SEEN] = 1
    if state.criteria_ints[c.CI_YIELD_SEEN] == 1:
        state.criteria[c.C_YIELD_TIMER_S] += statics.dt_s
        if state.criteria[c.C_YIELD_TIMER_S] >= YIELD_S:
            _close_yield(statics, state)
            state.criteria_ints[c.CI_SCENARIO_OVER] = 1


@inner
def _close_yield(statics: Statics, state: State) -> None:
    e, ego = statics.emergency_actor, state.ego
    dx, dy = state.actors[e, c.A_X] - ego[c.EGO_X], state.actors[e, c.A_Y] - ego[c.EGO_Y]
    ahead = dx * math.cos(ego[c.EGO_YAW]) + dy * math.sin(ego[c.EGO_YAW])
    if ahead <= 0.0 and state.actor_ints[e, c.I_ACTIVE] == 1:
        note(state, c.EVENT_YIELD, float(e), ahead)
    state.criteria_ints[c.CI_YIELD_SEEN] = 2


@inner
def _off_route_m(statics: Statics, state: State) -> float:
    """Return the distance to the nearest of the next five waypoints [m]."""
    first = state.criteria_ints[c.CI_PROGRESS]
    best = 1e18
    for k in range(first, min(first + 5, len(statics.route))):
        d = math.hypot(state.ego[c.EGO_X] - statics.route[k, 0], state.ego[c.EGO_Y] - statics.route[k, 1])
        best = min(best, d)
    return best


@inner
def _end(statics: Statics, state: State) -> int:
    ego, criteria, ints = state.ego, state.criteria, state.criteria_ints
    away = _off_route_m(statics, state)
    if away > DEVIATION_SOFT_M:
        criteria[c.C_OFFROUTE_M] += ego[c.EGO_V] * statics.dt_s
    criteria[c.C_STILL_S] = criteria[c.C_STILL_S] + statics.dt_s if ego[c.EGO_V] < STANDING_MPS else 0.0
    last = statics.route[-1]
    done_pct = 100.0 * statics.route_s[ints[c.CI_PROGRESS]] / statics.route_s[-1]
    if done_pct > COMPLETE_PCT and math.hypot(ego[c.EGO_X] - last[0], ego[c.EGO_Y] - last[1]) < COMPLETE_M:
        return c.END_COMPLETED
    if away >= DEVIATION_M or criteria[c.C_OFFROUTE_M] > DEVIATION_SHARE * statics.route_s[-1]:
        return c.END_DEVIATED
    sleeping = statics.blocked_test_off == 1 and _scenario_runs(state)
    if criteria[c.C_STILL_S] > BLOCKED_S and not sleeping:
        return c.END_BLOCKED
    if criteria[c.C_STILL_S] > statics.stuck_stop_s:
        return c.END_STUCK
    if state.clock[0] >= statics.tick_cap:
        return c.END_TICK_CAP
    return c.END_NONE


@inner
def judge(statics: Statics, state: State) -> None:
    """Judge all criteria of one tick, after everybody moved; write `CI_END` when the episode is over."""
    gained = _progress(statics, state)
    _wake_scenario(statics, state)
    _lane_keeping(statics, state, gained)
    _red_lights(statics, state)
    _stop_signs(statics, state)
    _speed(statics, state)
    _yield_test(statics, state)
    state.criteria_ints[c.CI_END] = _end(statics, state)


@inner
def finish(statics: Statics, state: State) -> None:
    """Close what is only known at the end: the last speed checkpoint, the emergency vehicle that never got past."""
    share = statics.route_s[state.criteria_ints[c.CI_PROGRESS]] / statics.route_s[-1]
    if share > 0.95 and state.criteria_ints[c.CI_SAMPLES] > 0:
        _speed_event(state)
    if state.criteria_ints[c.CI_YIELD_SEEN] == 1:
        _close_yield(statics, state)


def criteria_arrays() -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return fresh criteria rows for the start of an episode."""
    floats = np.zeros(c.CRITERIA_COLUMNS)
    floats[[c.C_LAST_HIT_X, c.C_LAST_HIT_Y]] = 1e9
    ints = np.zeros(c.CRITERIA_INTS, dtype=np.int64)
    ints[[c.CI_LAST_LANE, c.CI_STOP_LINE, c.CI_LAST_LIGHT]] = -1
    return floats, ints
