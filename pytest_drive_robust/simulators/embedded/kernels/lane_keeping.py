"""Judge lane keeping: metres of the route that the ego passes outside lanes or against the traffic."""

from __future__ import annotations

import math

from pytest_drive_robust.arithmetic.compiled import cos_sin, hypot, wrap_angle
from pytest_drive_robust.jit.kernels import inner
from pytest_drive_robust.simulators.criteria import OUTSIDE_M, WRONG_WAY_RAD
from pytest_drive_robust.simulators.embedded import state as c
from pytest_drive_robust.simulators.embedded.kernels.scenario import scenario_runs
from pytest_drive_robust.simulators.embedded.kernels.world_arrays import WorldArrays

WRONG_WAY_JUMP_RAD = math.radians(150.0)
"""Angle between two lanes on the road; an ego that changes from one to the other begins or ends the wrong way."""
TWO_WAYS_AFTER_S = 5.0
"""Seconds near the scenario's place until the oncoming lane is allowed (Bench2Drive `Idle(5)`)."""
_HAIR_M = 1e-6


@inner
def count_outside(world: WorldArrays, gained: float) -> None:
    """Count the metres of route `gained` in this tick if the ego is outside its lanes or drives against the traffic."""
    ego, ints = world.ego, world.criteria_ints
    last = ints[c.CI_LAST_LANE]
    lane, beside, heading = nearest_lane(world, ego[c.EGO_X], ego[c.EGO_Y], last)
    outside = beside > world.lane_width[lane] / 2.0 + OUTSIDE_M
    if world.lane_junction[lane] == 1:
        ints[c.CI_WRONG_WAY] = 0
    elif last >= 0 and lane != last:
        if world.lane_junction[last] == 1:
            ints[c.CI_WRONG_WAY] = 1 if _between(ego[c.EGO_YAW], heading) >= WRONG_WAY_RAD else 0
        else:
            before = _heading_of(world, last, ego[c.EGO_X], ego[c.EGO_Y])
            if _between(before, heading) > WRONG_WAY_JUMP_RAD:
                ints[c.CI_WRONG_WAY] = 1 - ints[c.CI_WRONG_WAY]
    ints[c.CI_LAST_LANE] = lane
    allowed = _both_ways_allowed(world)
    if outside or (ints[c.CI_WRONG_WAY] == 1 and not allowed):
        world.criteria[c.C_OUTSIDE_M] += gained


@inner
def _both_ways_allowed(world: WorldArrays) -> bool:
    """Return whether the scenario allows the ego to drive against the traffic now; count the seconds until then.

    The count starts when the ego comes near the scenario's place; driving against the traffic is allowed
    `TWO_WAYS_AFTER_S` later. Call this function exactly once a tick, because each call counts.
    """
    if world.two_ways == c.TWO_WAYS_NEVER or world.clock[c.STARTED] < 0:
        return False
    criteria, near = world.criteria, world.two_ways_near
    away, v = hypot(world.ego[c.EGO_X] - near[0], world.ego[c.EGO_Y] - near[1]), world.ego[c.EGO_V]
    if criteria[c.C_NEAR_S] > 0.0 or away < near[2] or (v > 0.0 and away / v < near[3]):
        criteria[c.C_NEAR_S] += world.dt_s
    over = world.two_ways == c.TWO_WAYS_WHILE_IT_RUNS and not scenario_runs(world)
    return criteria[c.C_NEAR_S] > TWO_WAYS_AFTER_S and not over


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
def _between(angle: float, other: float) -> float:
    """Return the unsigned difference of two angles, 0..pi."""
    return abs(wrap_angle(angle - other))
