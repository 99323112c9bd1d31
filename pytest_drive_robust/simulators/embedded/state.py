"""The world as arrays: kernels read `Statics` and write `State`; constants name the columns and what they hold."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pytest_drive_robust.jit.arrays import Floats1, Floats2, Floats3, Ints1, Ints2

DT_S = 0.05
EVENT_CAPACITY = 256

# Units: metres, seconds, radians, m/s, m/s2 and rad/s where a name does not say more.

# --- clock: one row of ints ---
TICK, STARTED = range(2)  # STARTED: the tick at which the scenario started, -1 before

# --- ego: one row of floats ---
EGO_X, EGO_Y, EGO_YAW, EGO_V, EGO_STEER, EGO_FORWARD, EGO_RIGHT, EGO_YAW_RATE = range(8)
"""Place and yaw, speed, angle of the wheels, acceleration ahead and to the right, yaw rate."""
EGO_COLUMNS = 8

# --- actors: one row of floats and one of ints each ---
A_ALONG_M, A_RIGHT_M, A_V, A_ACCEL, A_X, A_Y, A_YAW, A_LENGTH, A_WIDTH, A_HEIGHT = range(10)
"""Place along the actor's path and to its right, speed, acceleration; place and yaw in the world; size."""
A_TARGET_V, A_TARGET_RIGHT_M, A_LATERAL_MPS, A_END_M = range(10, 14)
# the script that a trigger starts: a speed and a lateral target for some seconds, then another speed
A_SCRIPT_V, A_SCRIPT_RIGHT_M, A_SCRIPT_S, A_AFTER_V, A_DELAY_S, A_TIMER_S = range(14, 20)
A_TRIGGER_TTA_S, A_TRIGGER_M, A_TRIGGER_X, A_TRIGGER_Y, A_TRIGGER_PROGRESS_M = range(20, 25)
A_SYNC_M, A_BRAKE_MAX, A_ACCEL_MAX, A_TURNED = range(25, 29)  # A_TURNED: yaw of a standing actor against its path
ACTOR_COLUMNS = 29

I_KIND, I_ACTIVE, I_MODE, I_PATH, I_STATE, I_PHASE, I_STUN, I_LAST_HIT, I_TRIGGER, I_AT_END = range(10)
I_BACKGROUND, I_OBEYS_LIGHTS, I_SOLID, I_LEASH, I_FLOW, I_RELATIVE, I_SEES = range(10, 17)
ACTOR_INTS = 17
# values: I_KIND an `ActorKind`, I_STATE an `ActorState`, I_STUN ticks for which a hit actor still stands, I_LAST_HIT a
# tick, I_PATH and I_FLOW numbers (I_FLOW -1: none); I_BACKGROUND, I_OBEYS_LIGHTS, I_SOLID, I_LEASH 0 or 1; the others:
ABSENT, PRESENT, NOT_YET = range(3)  # I_ACTIVE; NOT_YET: appears when the actor's script starts
MODE_STATIC, MODE_DRIVE, MODE_WALK = range(3)
PHASE_WAITING, PHASE_DELAYED, PHASE_SCRIPT, PHASE_DONE = range(4)
TRIGGER_NONE, TRIGGER_ARRIVAL, TRIGGER_PROGRESS = range(3)
AT_END_STAY, AT_END_LEAVE = range(2)
SPEED_OWN, SPEED_SHARE, SPEED_ABOVE = range(3)  # I_RELATIVE: script speed in m/s, share of the ego's, m/s above it
SEES_ALL, SEES_NOBODY, SEES_LATE = range(3)
NEVER_HIT = -100000  # I_LAST_HIT before the first hit

# --- flows: sources of cars at constant speed, one row of floats and one of ints each ---
F_SOURCE_M, F_SINK_M, F_SPEED, F_NEXT_GAP_M, F_RIGHT_M = range(5)
FLOW_COLUMNS = 5
FI_PATH, FI_FIRST_SLOT, FI_LAST_SLOT, FI_LATEST, FI_DRAWN = range(5)
"""Path, slots (actors' numbers) of its cars: the first, one after the last, the latest car's (-1: none); gaps drawn."""
FLOW_INTS = 5

# --- criteria: one row of floats and one of ints ---
C_OUTSIDE_M, C_OFFROUTE_M, C_STILL_S, C_EGO_SUM, C_TRAFFIC_SUM = range(5)
C_LAST_HIT_X, C_LAST_HIT_Y, C_CHECKPOINT_M, C_YIELD_TIMER_S, C_NEAR_S = range(5, 10)
"""Metres of route outside lanes and far from it, seconds at rest, sums of the ego's and the traffic's speeds since the
last checkpoint; place of the last collision, place of that checkpoint along the route, seconds of the test with the
emergency vehicle and near the scenario's place."""
CRITERIA_COLUMNS = 10
CI_PROGRESS, CI_LAST_LANE, CI_WRONG_WAY, CI_END, CI_EVENTS, CI_SAMPLES = range(6)
CI_STOP_LINE, CI_STOPPED, CI_LAST_LIGHT, CI_SCENARIO_OVER, CI_YIELD_SEEN, CI_NEAREST = range(6, 12)
"""Rows of the route (CI_PROGRESS, CI_NEAREST), lanes, stop lines and lights by number (-1: none), how many events and
summed speeds there are; CI_END is an END_*, CI_YIELD_SEEN a YIELD_*, the others are 0 or 1."""
CRITERIA_INTS = 12
YIELD_FAR, YIELD_NEAR, YIELD_JUDGED = range(3)
END_NONE, END_COMPLETED, END_DEVIATED, END_BLOCKED, END_TICK_CAP, END_STUCK = range(6)

TWO_WAYS_NEVER, TWO_WAYS_WHILE_IT_RUNS, TWO_WAYS_TO_THE_END = range(3)  # values of `Statics.two_ways`

# --- the survey of a tick: one row for each path and body ---
S_ALONG, S_RIGHT, S_LENGTH, S_WIDTH, S_SPEED = range(5)
SURVEY_COLUMNS = 5

# --- events: one row each ---
EVENT_COLLISION, EVENT_RED_LIGHT, EVENT_STOP_SIGN, EVENT_YIELD, EVENT_SPEED = range(5)
EV_KIND, EV_TICK, EV_ACTOR, EV_VALUE, EV_X, EV_Y = range(6)
"""EV_ACTOR: the actor, or the stop line, or -1 (a building, EVENT_SPEED). EV_VALUE: the ego's speed, or how far ahead
the emergency vehicle is, or the ego's speed in percent of the traffic's. EV_X, EV_Y: place of the ego."""
EVENT_COLUMNS = 6


class Statics(NamedTuple):
    """The arrays that stay constant within an episode."""

    dt_s: float
    tick_cap: int
    stuck_stop_s: float
    route: Floats2  # (n, 4): x, y, yaw, speed limit; about one row a metre
    route_s: Floats1  # (n,): distance along the route [m]
    trigger_m: float  # progress at which the scenario starts
    scenario_end_m: float  # progress at which the scenario is over
    blocked_test_off: int  # 1: the blocked test is off while the scenario runs
    two_ways: int  # how long the scenario allows driving against the traffic: TWO_WAYS_*
    two_ways_near: Floats1  # (4,): x, y, metres, seconds: within these of (x, y) the wait for `two_ways` begins
    emergency_actor: int  # the actor that must be let past, or -1
    ego_length_m: float
    ego_width_m: float
    paths: Floats2  # (total, 3): all paths of actors, one after the other
    path_start: Ints1  # (paths + 1,)
    path_step: Floats1  # (paths,): distance between two points of a path [m]
    path_stop_m: Floats1  # (paths,): where the path meets a light, or infinity
    path_stop_line: Ints1  # (paths,): which stop line that is, or -1
    lanes: Floats2  # (total, 3): centre points of driving and parking lanes
    lane_of: Ints1  # (total,): lane index of each centre point
    lane_start: Ints1  # (usable lanes + 1,): where each of those lanes begins among the points
    lane_step_m: float  # greatest distance of consecutive points of a lane
    lane_width: Floats1  # (lanes,)
    lane_junction: Ints1  # (lanes,)
    stop_lines: Floats2  # (stop lines, 4): x, y, heading, width
    stop_is_light: Ints1  # (stop lines,)
    stop_light: Ints1  # (stop lines,): equal for the lines that one light governs, side by side on the same way
    light_states: Ints2  # (stop lines, phases)
    light_until_s: Floats2  # (stop lines, phases): end of each phase, seconds after the scenario started
    light_before: Ints1  # (stop lines,): state before the scenario starts
    flow_gaps: Floats2  # (flows, draws): distances between two cars [m]
    buildings: Floats2  # (b, 6)
    patches: Floats2  # (p, 2): dirt on the road
    patch_noise: Floats3  # (p, n, 2): throttle and steer that a patch adds, one row a tick, over and over
    survey: Floats3  # (paths, actors + 1, 5): scratch, written anew in every tick


class State(NamedTuple):
    """The arrays that a tick changes."""

    clock: Ints1  # (2,)
    ego: Floats1  # (8,)
    actors: Floats2  # (k, 29)
    actor_ints: Ints2  # (k, 17)
    flows: Floats2  # (f, 5)
    flow_ints: Ints2  # (f, 5)
    lights: Ints1  # (stop lines,)
    criteria: Floats1  # (10,)
    criteria_ints: Ints1  # (12,)
    events: Floats2  # (EVENT_CAPACITY, 6)

    def noted(self) -> Floats2:
        """Return the events of the episode so far, one row each."""
        return self.events[: self.criteria_ints[CI_EVENTS]]

    def infractions(self) -> int:
        """Return how many events of the episode so far break a rule."""
        return int(np.count_nonzero(self.noted()[:, EV_KIND] != EVENT_SPEED))
