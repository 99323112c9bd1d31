"""Judge a tick by the leaderboard's criteria, after the ego and all actors moved.

Source: Bench2Drive `scenario_runner/srunner/scenariomanager/scenarioatomics/atomic_criteria.py` and
`leaderboard/leaderboard/scenarios/scenario_manager.py`; the constants are Bench2Drive's. `contacts` records collisions,
where the contact is computed.
"""

from __future__ import annotations

from pytest_drive_robust.arithmetic.compiled import cos_sin, hypot
from pytest_drive_robust.jit.kernels import inner
from pytest_drive_robust.simulators.criteria import (
    BLOCKED_S,
    CHECKPOINTS,
    COMPLETE_M,
    COMPLETE_PCT,
    DEVIATION_M,
    DEVIATION_SHARE,
    DEVIATION_SOFT_M,
    DEVIATION_WINDOW,
    LAST_CHECKPOINT_SHARE,
    ROUTE_WINDOW,
    STANDING_MPS,
)
from pytest_drive_robust.simulators.embedded import state as c
from pytest_drive_robust.simulators.embedded.kernels.contacts import note
from pytest_drive_robust.simulators.embedded.kernels.lane_keeping import count_outside
from pytest_drive_robust.simulators.embedded.kernels.lights_and_signs import judge_red_lights, judge_stop_signs
from pytest_drive_robust.simulators.embedded.kernels.scenario import scenario_runs, start_and_end
from pytest_drive_robust.simulators.embedded.kernels.world_arrays import WorldArrays

YIELD_NEAR_M = 50.0
YIELD_S = 10.0


@inner
def judge(world: WorldArrays) -> None:
    """Judge all criteria of one tick, after the ego and all actors moved; write `CI_END` when the episode is over."""
    gained = _progress(world)
    start_and_end(world)
    count_outside(world, gained)
    judge_red_lights(world)
    judge_stop_signs(world)
    _compare_speeds(world)
    _yield_test(world)
    world.criteria_ints[c.CI_END] = _end(world)


@inner
def close(world: WorldArrays) -> None:
    """Judge what is known only at the end: the last comparison of speeds, an emergency vehicle held up."""
    share = world.route_s[world.criteria_ints[c.CI_PROGRESS]] / world.route_s[-1]
    if share > LAST_CHECKPOINT_SHARE:
        _close_checkpoint(world)
    if world.criteria_ints[c.CI_YIELD_SEEN] == c.YIELD_NEAR:
        _close_yield(world)


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
def _compare_speeds(world: WorldArrays) -> None:
    """Update the driving efficiency: the ego's mean speed against the background traffic's, per 1/20 of the route."""
    criteria, ints = world.criteria, world.criteria_ints
    s = world.route_s[ints[c.CI_PROGRESS]]
    if s - criteria[c.C_CHECKPOINT_M] > world.route_s[-1] / CHECKPOINTS:
        criteria[c.C_CHECKPOINT_M] = s
        _close_checkpoint(world)  # this tick counts for the next one
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
def _close_checkpoint(world: WorldArrays) -> None:
    """Record the ego's mean speed since the last checkpoint in percent of the traffic's, 100 without traffic."""
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
    """Record an infraction when the emergency vehicle is not ahead of the ego; the test is over."""
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
    """Return why the episode is over (`END_*`), or `END_NONE`; count the seconds for which the ego stands."""
    ego, criteria, ints = world.ego, world.criteria, world.criteria_ints
    away = _off_route_m(world)
    criteria[c.C_STILL_S] = criteria[c.C_STILL_S] + world.dt_s if ego[c.EGO_V] < STANDING_MPS else 0.0
    last = world.route[-1]
    done_pct = 100.0 * world.route_s[ints[c.CI_PROGRESS]] / world.route_s[-1]
    if done_pct > COMPLETE_PCT and hypot(ego[c.EGO_X] - last[0], ego[c.EGO_Y] - last[1]) < COMPLETE_M:
        return c.END_COMPLETED
    if away >= DEVIATION_M or criteria[c.C_OFFROUTE_M] > DEVIATION_SHARE * world.route_s[-1]:
        return c.END_DEVIATED
    sleeping = world.blocked_test_off == 1 and scenario_runs(world)
    if criteria[c.C_STILL_S] > BLOCKED_S and not sleeping:
        return c.END_BLOCKED
    if criteria[c.C_STILL_S] > world.stuck_stop_s:
        return c.END_STUCK
    if world.clock[c.TICK] >= world.tick_cap:
        return c.END_TICK_CAP
    return c.END_NONE
