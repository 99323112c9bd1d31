"""What the vehicles decide: steering law, speed law, IDM and MOBIL."""

from __future__ import annotations

import math

import numpy as np

from pytest_drive_robust.simulators.compat import columns as c
from pytest_drive_robust.simulators.compat.arithmetic import arcsin, arctan, dot2, dot3, power, scalar_power, tan
from pytest_drive_robust.simulators.compat.columns import Arrays
from pytest_drive_robust.simulators.compat.compiled import part
from pytest_drive_robust.simulators.compat.graph import follow_road, neighbours, wanted_id
from pytest_drive_robust.simulators.compat.lanes import along, heading_at, is_reachable, wrap

__all__ = ["act", "control"]


@part
def _not_zero(x: float) -> float:
    if abs(x) > 1e-2:
        return x
    return 1e-2 if x >= 0 else -1e-2


@part
def _clip(x: float, low: float, high: float) -> float:
    return min(max(x, low), high)


@part
def _steer_to(arrays: Arrays, body: int, lane: int) -> float:
    """Steering angle [rad] of the cascaded law: lateral offset to heading, heading to yaw rate, yaw rate to angle."""
    machine, mine, speed = arrays.machine, arrays.bodies[body], arrays.bodies[body, c.B_SPEED]
    s, lateral = along(arrays, lane, body), arrays.coordinates[c.ACROSS, lane, body]
    future = heading_at(arrays, lane, s + speed * mine[c.P_TAU_PURSUIT])
    heading = mine[c.B_HEADING]
    if arrays.body_ints[body, c.I_KIND] == c.LINEAR:
        turn = wrap(future - heading) * mine[c.P_LENGTH] / _not_zero(speed)
        shift = -lateral * mine[c.P_LENGTH] / scalar_power(_not_zero(speed), mine[c.P_SQUARE])
        return dot2(machine, mine[c.P_STEERING], mine[c.P_STEERING + 1], turn, shift)
    sideways = -mine[c.P_KP_LATERAL] * lateral
    wanted = arcsin(machine, _clip(sideways / _not_zero(speed), -1.0, 1.0))
    wanted = future + _clip(wanted, -math.pi / 4, math.pi / 4)
    rate = mine[c.P_KP_HEADING] * wrap(wanted - heading)
    slip = arcsin(machine, _clip(mine[c.P_LENGTH] / 2 / _not_zero(speed) * rate, -1.0, 1.0))
    angle = arctan(machine, 2 * tan(machine, slip))
    return _clip(angle, -mine[c.P_MAX_STEERING], mine[c.P_MAX_STEERING])


@part
def _steer(arrays: Arrays, body: int) -> None:
    most = arrays.bodies[body, c.P_MAX_STEERING]
    angle = _steer_to(arrays, body, arrays.body_ints[body, c.I_TARGET_LANE])
    arrays.bodies[body, c.B_STEERING] = _clip(angle, -most, most)


@part
def _gap_to(arrays: Arrays, body: int, other: int) -> float:
    """Distance from one body to another along the first one's lane [m], centre to centre."""
    lane = arrays.body_ints[body, c.I_LANE]
    return along(arrays, lane, other) - along(arrays, lane, body)


@part
def _desired_gap(arrays: Arrays, judge: int, body: int, front: int) -> float:
    """The gap [m] that `judge` holds to be right for `body` behind `front`."""
    mine, theirs, parameters = arrays.bodies[body], arrays.bodies[front], arrays.bodies[judge]
    speed = mine[c.B_SPEED]
    comfort = -parameters[c.P_COMFORT_ACC_MAX] * parameters[c.P_COMFORT_ACC_MIN]
    closing = dot2(
        arrays.machine,
        speed * mine[c.B_COS] - theirs[c.B_SPEED] * theirs[c.B_COS],
        speed * mine[c.B_SIN] - theirs[c.B_SPEED] * theirs[c.B_SIN],
        mine[c.B_COS],
        mine[c.B_SIN],
    )
    return float(
        parameters[c.P_DISTANCE_WANTED]
        + speed * parameters[c.P_TIME_WANTED]
        + speed * closing / (2 * math.sqrt(comfort))
    )


@part
def _linear_acceleration(arrays: Arrays, judge: int, body: int, front: int) -> float:
    parameters = arrays.bodies[judge]
    to_target, closing, short = 0.0, 0.0, 0.0
    if body >= 0:
        speed = arrays.bodies[body, c.B_SPEED]
        if arrays.body_ints[body, c.I_KIND] >= c.CONTROLLED:
            to_target = arrays.bodies[body, c.B_TARGET_SPEED] - speed
        safe = parameters[c.P_DISTANCE_WANTED] + max(speed, 0.0) * parameters[c.P_TIME_WANTED]
        if front >= 0:
            closing = min(arrays.bodies[front, c.B_SPEED] - speed, 0.0)
            short = min(_gap_to(arrays, body, front) - safe, 0.0)
    weights = parameters[c.P_ACCELERATION : c.P_ACCELERATION + 3]
    return dot3(arrays.machine, weights[0], weights[1], weights[2], to_target, closing, short)


@part
def _acceleration(arrays: Arrays, judge: int, body: int, front: int) -> float:
    """Acceleration [m/s2] of `body` behind `front` (-1: nobody) by the model and the parameters of `judge`."""
    if arrays.body_ints[judge, c.I_KIND] == c.LINEAR:
        return _linear_acceleration(arrays, judge, body, front)
    if body < 0 or arrays.body_ints[body, c.I_KIND] < c.PLAIN:
        return 0.0
    comfort = arrays.bodies[judge, c.P_COMFORT_ACC_MAX]
    target = arrays.bodies[body, c.B_TARGET_SPEED] if arrays.body_ints[body, c.I_KIND] >= c.CONTROLLED else 0.0
    limit = arrays.lanes[arrays.body_ints[body, c.I_LANE], c.L_SPEED_LIMIT]
    if not math.isnan(limit):
        target = _clip(target, 0.0, limit)
    share = max(arrays.bodies[body, c.B_SPEED], 0.0) / abs(_not_zero(target))
    free = comfort * (1 - power(arrays.machine, share, arrays.bodies[judge, c.P_DELTA]))
    if front < 0:
        return float(free)
    share = _desired_gap(arrays, judge, body, front) / _not_zero(_gap_to(arrays, body, front))
    return float(free - comfort * power(arrays.machine, share, arrays.bodies[judge, c.P_SQUARE]))


@part
def _is_worth_it(arrays: Arrays, body: int, lane: int) -> bool:
    """MOBIL: nobody must brake hard, and the change gains acceleration, or the route wants it."""
    parameters = arrays.bodies[body]
    front, rear = neighbours(arrays, body, lane)
    rear_now = _acceleration(arrays, body, rear, front)
    rear_then = _acceleration(arrays, body, rear, body)
    if rear_then < -parameters[c.P_MAX_BRAKING_IMPOSED]:
        return False
    old_front, old_rear = neighbours(arrays, body, arrays.body_ints[body, c.I_LANE])
    mine_then = _acceleration(arrays, body, body, front)
    asked = wanted_id(arrays, body)
    if asked != c.NO_ID:
        target = arrays.lane_ints[arrays.body_ints[body, c.I_TARGET_LANE], c.LI_ID]
        if np.sign(arrays.lane_ints[lane, c.LI_ID] - target) != np.sign(asked - target):
            return False
        return not mine_then < -parameters[c.P_MAX_BRAKING_IMPOSED]
    mine_now = _acceleration(arrays, body, body, old_front)
    old_rear_now = _acceleration(arrays, body, old_rear, body)
    old_rear_then = _acceleration(arrays, body, old_rear, old_front)
    others = rear_then - rear_now + old_rear_then - old_rear_now
    return not mine_then - mine_now + parameters[c.P_POLITENESS] * others < parameters[c.P_MIN_GAIN]


@part
def _give_way_to_an_earlier_change(arrays: Arrays, body: int) -> None:
    """Abort a lane change when somebody shortly ahead is already changing into the same lane."""
    mine = arrays.body_ints[body]
    if arrays.lane_ints[mine[c.I_LANE], c.LI_EDGE] != arrays.lane_ints[mine[c.I_TARGET_LANE], c.LI_EDGE]:
        return
    for other in range(arrays.bodies.shape[0]):
        theirs = arrays.body_ints[other]
        if other == body or theirs[c.I_KIND] < c.CONTROLLED or theirs[c.I_LANE] == mine[c.I_TARGET_LANE]:
            continue
        if theirs[c.I_TARGET_LANE] == mine[c.I_TARGET_LANE]:
            gap = _gap_to(arrays, body, other)
            if 0 < gap < _desired_gap(arrays, body, body, other):
                mine[c.I_TARGET_LANE] = mine[c.I_LANE]
                return


@part
def _choose_lane(arrays: Arrays, body: int) -> None:
    mine = arrays.body_ints[body]
    lane = mine[c.I_LANE]
    if lane != mine[c.I_TARGET_LANE]:
        _give_way_to_an_earlier_change(arrays, body)
        return
    if not arrays.bodies[body, c.P_CHANGE_DELAY] < arrays.bodies[body, c.B_TIMER]:
        return
    arrays.bodies[body, c.B_TIMER] = 0.0
    edge, place = arrays.edges[arrays.lane_ints[lane, c.LI_EDGE]], arrays.lane_ints[lane, c.LI_ID]
    for side in (place - 1, place + 1):
        if side < 0 or side >= edge[c.E_COUNT]:
            continue
        number = edge[c.E_FIRST] + side
        if not is_reachable(arrays, number, body) or abs(arrays.bodies[body, c.B_SPEED]) < 1:
            continue
        if _is_worth_it(arrays, body, number):
            mine[c.I_TARGET_LANE] = number


@part
def _drive(arrays: Arrays, body: int) -> None:
    """One decision of an IDM or linear driver."""
    if arrays.body_ints[body, c.I_CRASHED]:
        return
    follow_road(arrays, body)
    if arrays.body_ints[body, c.I_CHANGES_LANE]:
        _choose_lane(arrays, body)
    _steer(arrays, body)
    lane, target = arrays.body_ints[body, c.I_LANE], arrays.body_ints[body, c.I_TARGET_LANE]
    wanted = _acceleration(arrays, body, body, neighbours(arrays, body, lane)[0])
    if lane != target:
        wanted = min(wanted, _acceleration(arrays, body, body, neighbours(arrays, body, target)[0]))
    most = arrays.bodies[body, c.P_ACC_MAX]
    arrays.bodies[body, c.B_ACCELERATION] = _clip(wanted, -most, most)


@part
def control(arrays: Arrays, body: int) -> None:
    """The two low-level controllers of a vehicle that holds a lane and a speed."""
    _steer(arrays, body)
    gain, speed = arrays.bodies[body, c.P_KP_A], arrays.bodies[body, c.B_SPEED]
    arrays.bodies[body, c.B_ACCELERATION] = gain * (arrays.bodies[body, c.B_TARGET_SPEED] - speed)


@part
def act(arrays: Arrays, body: int) -> None:
    """Decide without being told anything; a plain vehicle goes on with what it was told last."""
    kind = arrays.body_ints[body, c.I_KIND]
    if kind >= c.IDM:
        _drive(arrays, body)
    elif kind >= c.CONTROLLED:
        follow_road(arrays, body)
        control(arrays, body)
