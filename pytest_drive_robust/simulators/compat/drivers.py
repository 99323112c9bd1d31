"""What the vehicles decide: steering law, speed law, IDM, MOBIL, and what a told ego does."""

from __future__ import annotations

import math

import numba
import numpy as np

from pytest_drive_robust.simulators.compat import columns as c
from pytest_drive_robust.simulators.compat.arithmetic import arcsin, arctan, dot2, dot3, power, scalar_power, tan
from pytest_drive_robust.simulators.compat.columns import Arrays
from pytest_drive_robust.simulators.compat.graph import follow_road, neighbours, wanted_id
from pytest_drive_robust.simulators.compat.lanes import along, heading_at, is_reachable, wrap

__all__ = ["act", "tell"]

_jit = numba.njit(cache=True)


@_jit
def _not_zero(x: float) -> float:
    if abs(x) > 1e-2:
        return x
    return 1e-2 if x >= 0 else -1e-2


@_jit
def _clip(x: float, low: float, high: float) -> float:
    return min(max(x, low), high)


@_jit
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


@_jit
def _steer(arrays: Arrays, body: int) -> None:
    most = arrays.bodies[body, c.P_MAX_STEERING]
    angle = _steer_to(arrays, body, arrays.body_ints[body, c.I_TARGET_LANE])
    arrays.bodies[body, c.B_STEERING] = _clip(angle, -most, most)


@_jit
def _gap_to(arrays: Arrays, body: int, other: int) -> float:
    """Distance from one body to another along the first one's lane [m], centre to centre."""
    lane = arrays.body_ints[body, c.I_LANE]
    return along(arrays, lane, other) - along(arrays, lane, body)


@_jit
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


@_jit
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


@_jit
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


@_jit
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


@_jit
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


@_jit
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


@_jit
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


@_jit
def _control(arrays: Arrays, body: int) -> None:
    """The two low-level controllers of a vehicle that holds a lane and a speed."""
    _steer(arrays, body)
    gain, speed = arrays.bodies[body, c.P_KP_A], arrays.bodies[body, c.B_SPEED]
    arrays.bodies[body, c.B_ACCELERATION] = gain * (arrays.bodies[body, c.B_TARGET_SPEED] - speed)


@_jit
def act(arrays: Arrays, body: int) -> None:
    """Decide without being told anything; a plain vehicle goes on with what it was told last."""
    kind = arrays.body_ints[body, c.I_KIND]
    if kind >= c.IDM:
        _drive(arrays, body)
    elif kind >= c.CONTROLLED:
        follow_road(arrays, body)
        _control(arrays, body)


@_jit
def _step_speed(arrays: Arrays, body: int, change: int, speeds: c.Floats) -> None:
    """Aim at the next higher (+1) or lower (-1) of the target speeds of an MDP vehicle."""
    count = len(speeds)
    share = (arrays.bodies[body, c.B_SPEED] - speeds[0]) / (speeds[count - 1] - speeds[0])
    index = int(_clip(np.rint(share * (count - 1)), 0.0, count - 1.0)) + change
    index = min(max(index, 0), count - 1)
    arrays.body_ints[body, c.I_SPEED_INDEX], arrays.bodies[body, c.B_TARGET_SPEED] = index, speeds[index]


@_jit
def _aim_beside(arrays: Arrays, body: int, side: int) -> None:
    target = arrays.body_ints[body, c.I_TARGET_LANE]
    edge = arrays.edges[arrays.lane_ints[target, c.LI_EDGE]]
    place = min(max(arrays.lane_ints[target, c.LI_ID] + side, 0), edge[c.E_COUNT] - 1)
    if is_reachable(arrays, edge[c.E_FIRST] + place, body):
        arrays.body_ints[body, c.I_TARGET_LANE] = edge[c.E_FIRST] + place


@_jit
def tell(arrays: Arrays, body: int, told: int, speeds: c.Floats) -> None:
    """`vehicle.act(action)` of a controlled vehicle, before everybody acts; `speeds`: the choices of an MDP vehicle."""
    kind = arrays.body_ints[body, c.I_KIND]
    if kind >= c.IDM:
        act(arrays, body)
        return
    faster = 1 if told == c.TOLD_FASTER else (-1 if told == c.TOLD_SLOWER else 0)
    if kind == c.MDP and faster:
        _step_speed(arrays, body, faster, speeds)
    follow_road(arrays, body)
    if kind == c.CONTROLLED and faster == 1:
        arrays.bodies[body, c.B_TARGET_SPEED] += arrays.bodies[body, c.P_DELTA_SPEED]
    elif kind == c.CONTROLLED and faster == -1:
        arrays.bodies[body, c.B_TARGET_SPEED] -= arrays.bodies[body, c.P_DELTA_SPEED]
    elif told == c.TOLD_RIGHT:
        _aim_beside(arrays, body, 1)
    elif told == c.TOLD_LEFT:
        _aim_beside(arrays, body, -1)
    _control(arrays, body)
