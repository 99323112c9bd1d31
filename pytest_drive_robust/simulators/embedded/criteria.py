"""The leaderboard's criteria and ends of an episode, one compiled pass per tick.

Source: Bench2Drive `scenario_runner/srunner/scenariomanager/scenarioatomics/atomic_criteria.py` and
`leaderboard/leaderboard/scenarios/scenario_manager.py`; the constants are Bench2Drive's. `kernels.contacts` records
collisions, where the contact is computed.
"""

from __future__ import annotations

import math

import numpy as np

from pytest_drive_robust.arithmetic.compiled import cos, cos_sin, hypot, wrap_angle
from pytest_drive_robust.domain.truth import LightState
from pytest_drive_robust.jit.arrays import Floats, Ints
from pytest_drive_robust.jit.kernels import entry, inner
from pytest_drive_robust.simulators.embedded import state as c
from pytest_drive_robust.simulators.embedded.kernels.contacts import note
from pytest_drive_robust.simulators.embedded.kernels.world_arrays import WorldArrays

ROUTE_WINDOW = 3  # the current waypoint and the next two
COMPLETE_PCT = 99.0
COMPLETE_M = 10.0
OUTSIDE_M = 0.5
WRONG_WAY_AFTER_JUNCTION_RAD = math.radians(120.0)
WRONG_WAY_JUMP_RAD = math.radians(150.0)
DEVIATION_M = 30.0
DEVIATION_SOFT_M = 15.0
DEVIATION_SHARE = 0.30
DEVIATION_WINDOW = 6  # the nearest waypoint so far and the next five
BLOCKED_S = 60.0
LIGHT_RADIUS_M = 15.0
STOP_RADIUS_M = 4.0
CHECKPOINTS = 20
LAST_CHECKPOINT_SHARE = 0.95
TRIGGER_RADIUS_M = 2.0
TWO_WAYS_AFTER_S = 5.0
YIELD_NEAR_M = 50.0
YIELD_S = 10.0
_HAIR_M = 1e-6

_RED = int(LightState.RED)


@inner
def _between(angle: float, other: float) -> float:
    """Return the unsigned difference of two angles, 0..pi."""
    return abs(wrap_angle(angle - other))


@inner
def _nearest_point(world: WorldArrays, lane: int, x: float, y: float, best: float, at: int) -> tuple[float, int]:
    """Return distance and row of the usable lane's first nearest point, or `best` and `at` when none is nearer."""
    k, end = world.lane_start[lane], world.lane_start[lane + 1]
    while k < end:
        dx, dy = x - world.lanes[k, 0], y - world.lanes[k, 1]
        d = math.sqrt(dx * dx + dy * dy)
        if d < best:
            best, at = d, k
        # consecutive points are at most `lane_step_m` apart, so the skipped points cannot be nearer than `best`
        k += max(1, int((d - best) / world.lane_step_m))
    return best, at


@inner
def nearest_lane(world: WorldArrays, x: float, y: float, last: int) -> tuple[int, float, float]:
    """Return (lane, distance to its centre line [m], heading there) of the nearest driving or parking lane.

    `last` is a lane that is probably near, or -1. `last` changes the number of points examined, never the result.
    """
    best, at = 1e18, 0
    for lane in range(len(world.lane_start) - 1):
        if world.lane_of[world.lane_start[lane]] == last:
            best, at = _nearest_point(world, lane, x, y, best, at)
            best += _HAIR_M  # among equally near points the first one counts
            break
    for lane in range(len(world.lane_start) - 1):
        best, at = _nearest_point(world, lane, x, y, best, at)
    heading = world.lanes[at, 2]
    dx, dy = x - world.lanes[at, 0], y - world.lanes[at, 1]
    ch, sh = cos_sin(heading)
    along, beside = dx * ch + dy * sh, abs(-dx * sh + dy * ch)
    if abs(along) > 1.0:  # beyond the end of the lane
        beside = hypot(beside, abs(along))
    return world.lane_of[at], beside, heading


@inner
def _progress(world: WorldArrays) -> float:
    """Advance the index of the current waypoint; return the metres of route gained in this tick."""
    ints, ego = world.criteria_ints, world.ego
    before = ints[c.CI_PROGRESS]
    reached = before
    for k in range(before, min(before + ROUTE_WINDOW, len(world.route))):
        ch, sh = cos_sin(world.route[k, 2])
        dx, dy = ego[c.EGO_X] - world.route[k, 0], ego[c.EGO_Y] - world.route[k, 1]
        if dx * ch + dy * sh > 0.0:
            reached = k
    ints[c.CI_PROGRESS] = reached
    return float(world.route_s[reached] - world.route_s[before])


@inner
def _start_scenario(world: WorldArrays) -> None:
    s = world.route_s[world.criteria_ints[c.CI_PROGRESS]]
    if world.clock[1] < 0 and s >= world.trigger_m - TRIGGER_RADIUS_M:
        world.clock[1] = world.clock[0]
    if world.clock[1] >= 0 and s >= world.scenario_end_m:
        world.criteria_ints[c.CI_SCENARIO_OVER] = 1


@inner
def _scenario_runs(world: WorldArrays) -> bool:
    return bool(world.clock[1] >= 0 and world.criteria_ints[c.CI_SCENARIO_OVER] == 0)


@inner
def _lane_keeping(world: WorldArrays, gained: float) -> None:
    """Count the metres of route that are passed outside lanes or against the traffic."""
    ego, ints = world.ego, world.criteria_ints
    last = ints[c.CI_LAST_LANE]
    lane, beside, heading = nearest_lane(world, ego[c.EGO_X], ego[c.EGO_Y], last)
    outside = beside > world.lane_width[lane] / 2.0 + OUTSIDE_M
    if world.lane_junction[lane] == 1:
        ints[c.CI_WRONG_WAY] = 0
    elif last >= 0 and lane != last:
        if world.lane_junction[last] == 1:
            ints[c.CI_WRONG_WAY] = 1 if _between(ego[c.EGO_YAW], heading) >= WRONG_WAY_AFTER_JUNCTION_RAD else 0
        else:
            before = _heading_of(world, last, ego[c.EGO_X], ego[c.EGO_Y])
            if _between(before, heading) > WRONG_WAY_JUMP_RAD:
                ints[c.CI_WRONG_WAY] = 1 - ints[c.CI_WRONG_WAY]
    ints[c.CI_LAST_LANE] = lane
    allowed = _count_to_both_ways(world)
    if outside or (ints[c.CI_WRONG_WAY] == 1 and not allowed):
        world.criteria[c.C_OUTSIDE_M] += gained


@inner
def _count_to_both_ways(world: WorldArrays) -> bool:
    """Return whether the scenario allows the ego to drive against the traffic now; count the seconds until then.

    The count starts when the ego comes near the scenario's place; driving against the traffic is allowed
    `TWO_WAYS_AFTER_S` later. Call this function exactly once a tick, because each call counts.
    """
    if world.two_ways == c.TWO_WAYS_NEVER or world.clock[1] < 0:
        return False
    criteria, near = world.criteria, world.two_ways_near
    away, v = hypot(world.ego[c.EGO_X] - near[0], world.ego[c.EGO_Y] - near[1]), world.ego[c.EGO_V]
    if criteria[c.C_NEAR_S] > 0.0 or away < near[2] or (v > 0.0 and away / v < near[3]):
        criteria[c.C_NEAR_S] += world.dt_s
    over = world.two_ways == c.TWO_WAYS_WHILE_IT_RUNS and not _scenario_runs(world)
    return criteria[c.C_NEAR_S] > TWO_WAYS_AFTER_S and not over


@inner
def _heading_of(world: WorldArrays, lane: int, x: float, y: float) -> float:
    """Return the heading of a lane at its point nearest to (x, y)."""
    best, at = 1e18, 0
    for k in range(len(world.lanes)):
        if world.lane_of[k] != lane:
            continue
        dx, dy = x - world.lanes[k, 0], y - world.lanes[k, 1]
        d = dx * dx + dy * dy
        if d < best:
            best, at = d, k
    return float(world.lanes[at, 2])


@inner
def _crosses(ax: float, ay: float, bx: float, by: float, px: float, py: float, qx: float, qy: float) -> bool:
    """Return whether the segments a-b and p-q cross."""
    d1 = (bx - ax) * (py - ay) - (by - ay) * (px - ax)
    d2 = (bx - ax) * (qy - ay) - (by - ay) * (qx - ax)
    d3 = (qx - px) * (ay - py) - (qy - py) * (ax - px)
    d4 = (qx - px) * (by - py) - (qy - py) * (bx - px)
    return d1 * d2 < 0.0 and d3 * d4 < 0.0


@inner
def _red_lights(world: WorldArrays) -> None:
    """Record an infraction when the rear of the ego crosses the stop line of a red light in the direction of the lane.

    Stop lines are wider than their lanes, so a rear between two lanes crosses both lines. A light counts once, because
    Bench2Drive counts by the id of the light.
    """
    ego = world.ego
    half = world.ego_length_m / 2.0
    ch, sh = cos_sin(ego[c.EGO_YAW])
    ax, ay = ego[c.EGO_X] - 0.8 * half * ch, ego[c.EGO_Y] - 0.8 * half * sh
    bx, by = ego[c.EGO_X] - (half + 1.0) * ch, ego[c.EGO_Y] - (half + 1.0) * sh
    for k in range(len(world.stop_lines)):
        light = world.stop_light[k]
        if world.stop_is_light[k] == 0 or world.lights[k] != _RED or world.criteria_ints[c.CI_LAST_LIGHT] == light:
            continue
        x, y, heading, width = world.stop_lines[k]
        if hypot(x - ego[c.EGO_X], y - ego[c.EGO_Y]) > LIGHT_RADIUS_M or cos(heading - ego[c.EGO_YAW]) < 0.2:
            continue
        ahead_x, ahead_y = cos_sin(heading)
        rx, ry = -ahead_y * 0.6 * width, ahead_x * 0.6 * width
        if _crosses(ax, ay, bx, by, x - rx, y - ry, x + rx, y + ry):
            world.criteria_ints[c.CI_LAST_LIGHT] = light
            note(world, c.EVENT_RED_LIGHT, float(k), 0.0)


@inner
def _stop_signs(world: WorldArrays) -> None:
    """Record an infraction when the ego leaves a stop sign without having stopped."""
    ego, ints = world.ego, world.criteria_ints
    current = ints[c.CI_STOP_LINE]
    front = world.ego_length_m / 2.0
    ch, sh = cos_sin(ego[c.EGO_YAW])
    fx, fy = ego[c.EGO_X] + front * ch, ego[c.EGO_Y] + front * sh
    if current < 0:
        for k in range(len(world.stop_lines)):
            x, y, heading, _ = world.stop_lines[k]
            near = hypot(x - fx, y - fy) < STOP_RADIUS_M
            if world.stop_is_light[k] == 0 and near and cos(heading - ego[c.EGO_YAW]) > 0.5:
                ints[c.CI_STOP_LINE], ints[c.CI_STOPPED] = k, 0
                current = k
                break
    if current < 0:
        return
    if ego[c.EGO_V] < c.STANDING_MPS:
        ints[c.CI_STOPPED] = 1
    x, y, heading, _ = world.stop_lines[current]
    ch, sh = cos_sin(heading)
    beyond = (ego[c.EGO_X] - x) * ch + (ego[c.EGO_Y] - y) * sh
    away = hypot(x - ego[c.EGO_X], y - ego[c.EGO_Y])
    if beyond > front and away > STOP_RADIUS_M:
        if ints[c.CI_STOPPED] == 0:
            note(world, c.EVENT_STOP_SIGN, float(current), ego[c.EGO_V])
        ints[c.CI_STOP_LINE] = -1


@inner
def _speed(world: WorldArrays) -> None:
    """Update the driving efficiency: the ego's mean speed against the background traffic's, per 1/20 of the route."""
    criteria, ints = world.criteria, world.criteria_ints
    s = world.route_s[ints[c.CI_PROGRESS]]
    if s - criteria[c.C_CHECKPOINT_M] > world.route_s[-1] / CHECKPOINTS:
        criteria[c.C_CHECKPOINT_M] = s
        _speed_event(world)  # this tick counts for the next one
    total, count = 0.0, 0
    for i in range(len(world.actors)):
        if world.actor_ints[i, c.I_BACKGROUND] == 1 and world.actor_ints[i, c.I_ACTIVE] == c.PRESENT:
            total += world.actors[i, c.A_V]
            count += 1
    if count > 0:
        criteria[c.C_EGO_SUM] += world.ego[c.EGO_V]
        criteria[c.C_TRAFFIC_SUM] += total / count
        ints[c.CI_SAMPLES] += 1


@inner
def _speed_event(world: WorldArrays) -> None:
    criteria, ints = world.criteria, world.criteria_ints
    ratio = 100.0
    if ints[c.CI_SAMPLES] > 0 and criteria[c.C_TRAFFIC_SUM] > 0.0:
        ratio = round(100.0 * criteria[c.C_EGO_SUM] / criteria[c.C_TRAFFIC_SUM], 2)
    note(world, c.EVENT_SPEED, -1.0, ratio)
    criteria[c.C_EGO_SUM], criteria[c.C_TRAFFIC_SUM] = 0.0, 0.0
    ints[c.CI_SAMPLES] = 0


@inner
def _yield_test(world: WorldArrays) -> None:
    """Record an infraction when the emergency vehicle is not ahead of the ego 10 s after coming within 50 m."""
    e = world.emergency_actor
    if e < 0 or world.actor_ints[e, c.I_ACTIVE] != c.PRESENT or world.criteria_ints[c.CI_YIELD_SEEN] == c.YIELD_JUDGED:
        return
    dx, dy = world.actors[e, c.A_X] - world.ego[c.EGO_X], world.actors[e, c.A_Y] - world.ego[c.EGO_Y]
    if hypot(dx, dy) < YIELD_NEAR_M:
        world.criteria_ints[c.CI_YIELD_SEEN] = c.YIELD_NEAR
    if world.criteria_ints[c.CI_YIELD_SEEN] == c.YIELD_NEAR:
        world.criteria[c.C_YIELD_TIMER_S] += world.dt_s
        if world.criteria[c.C_YIELD_TIMER_S] >= YIELD_S:
            _close_yield(world)
            world.criteria_ints[c.CI_SCENARIO_OVER] = 1


@inner
def _close_yield(world: WorldArrays) -> None:
    e, ego = world.emergency_actor, world.ego
    dx, dy = world.actors[e, c.A_X] - ego[c.EGO_X], world.actors[e, c.A_Y] - ego[c.EGO_Y]
    ch, sh = cos_sin(ego[c.EGO_YAW])
    ahead = dx * ch + dy * sh
    if ahead <= 0.0 and world.actor_ints[e, c.I_ACTIVE] == c.PRESENT:
        note(world, c.EVENT_YIELD, float(e), ahead)
    world.criteria_ints[c.CI_YIELD_SEEN] = c.YIELD_JUDGED


@inner
def _off_route_m(world: WorldArrays) -> float:
    """Update the nearest waypoint; return its distance [m] and count the metres of route that pass too far away."""
    criteria, ints = world.criteria, world.criteria_ints
    before = ints[c.CI_NEAREST]
    best, nearest = 1e18, before
    for k in range(before, min(before + DEVIATION_WINDOW, len(world.route))):
        d = hypot(world.ego[c.EGO_X] - world.route[k, 0], world.ego[c.EGO_Y] - world.route[k, 1])
        if d <= best:
            best, nearest = d, k
    if best >= DEVIATION_SOFT_M:
        criteria[c.C_OFFROUTE_M] += world.route_s[nearest] - world.route_s[before]
    ints[c.CI_NEAREST] = nearest
    return best


@inner
def _end(world: WorldArrays) -> int:
    ego, criteria, ints = world.ego, world.criteria, world.criteria_ints
    away = _off_route_m(world)
    criteria[c.C_STILL_S] = criteria[c.C_STILL_S] + world.dt_s if ego[c.EGO_V] < c.STANDING_MPS else 0.0
    last = world.route[-1]
    done_pct = 100.0 * world.route_s[ints[c.CI_PROGRESS]] / world.route_s[-1]
    if done_pct > COMPLETE_PCT and hypot(ego[c.EGO_X] - last[0], ego[c.EGO_Y] - last[1]) < COMPLETE_M:
        return c.END_COMPLETED
    if away >= DEVIATION_M or criteria[c.C_OFFROUTE_M] > DEVIATION_SHARE * world.route_s[-1]:
        return c.END_DEVIATED
    sleeping = world.blocked_test_off == 1 and _scenario_runs(world)
    if criteria[c.C_STILL_S] > BLOCKED_S and not sleeping:
        return c.END_BLOCKED
    if criteria[c.C_STILL_S] > world.stuck_stop_s:
        return c.END_STUCK
    if world.clock[0] >= world.tick_cap:
        return c.END_TICK_CAP
    return c.END_NONE


@inner
def judge(world: WorldArrays) -> None:
    """Judge all criteria of one tick, after the ego and all actors moved; write `CI_END` when the episode is over."""
    gained = _progress(world)
    _start_scenario(world)
    _lane_keeping(world, gained)
    _red_lights(world)
    _stop_signs(world)
    _speed(world)
    _yield_test(world)
    world.criteria_ints[c.CI_END] = _end(world)


@entry
def finish(world: WorldArrays) -> None:
    """Judge the criteria that are known only at the end: the last speed checkpoint, an emergency vehicle held up."""
    share = world.route_s[world.criteria_ints[c.CI_PROGRESS]] / world.route_s[-1]
    if share > LAST_CHECKPOINT_SHARE:
        _speed_event(world)
    if world.criteria_ints[c.CI_YIELD_SEEN] == c.YIELD_NEAR:
        _close_yield(world)


def criteria_arrays() -> tuple[Floats, Ints]:
    """Return fresh criteria rows for the start of an episode."""
    floats = np.zeros(c.CRITERIA_COLUMNS)
    floats[[c.C_LAST_HIT_X, c.C_LAST_HIT_Y]] = 1e9
    ints = np.zeros(c.CRITERIA_INTS, dtype=np.int64)
    ints[[c.CI_LAST_LANE, c.CI_STOP_LINE, c.CI_LAST_LIGHT]] = -1
    return floats, ints
