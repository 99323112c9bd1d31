"""The modified bicycle model: one explicit Euler step of one vehicle."""

from __future__ import annotations

from pytest_drive_robust.simulators.compat import columns as c
from pytest_drive_robust.simulators.compat.arithmetic import arctan, cos, sin, tan
from pytest_drive_robust.simulators.compat.columns import Arrays
from pytest_drive_robust.simulators.compat.compiled import part
from pytest_drive_robust.simulators.compat.lanes import locate

__all__ = ["face", "move"]


@part
def face(arrays: Arrays, body: int) -> None:
    """Enter the direction of a body's heading."""
    mine = arrays.bodies[body]
    mine[c.B_COS], mine[c.B_SIN] = cos(arrays.machine, mine[c.B_HEADING]), sin(arrays.machine, mine[c.B_HEADING])


@part
def _limit_controls(arrays: Arrays, body: int) -> None:
    """A wreck brakes; beyond the speed limits of the vehicle the acceleration leads back to them."""
    mine = arrays.bodies[body]
    if arrays.body_ints[body, c.I_CRASHED]:
        mine[c.B_STEERING], mine[c.B_ACCELERATION] = 0.0, -1.0 * mine[c.B_SPEED]
    if mine[c.B_SPEED] > mine[c.P_MAX_SPEED]:
        mine[c.B_ACCELERATION] = min(mine[c.B_ACCELERATION], mine[c.P_MAX_SPEED] - mine[c.B_SPEED])
    elif mine[c.B_SPEED] < mine[c.P_MIN_SPEED]:
        mine[c.B_ACCELERATION] = max(mine[c.B_ACCELERATION], mine[c.P_MIN_SPEED] - mine[c.B_SPEED])


@part
def move(arrays: Arrays, body: int, dt_s: float) -> None:
    """Advance a vehicle, push it by the impact of its last collision, find its lane."""
    mine, ints, machine = arrays.bodies[body], arrays.body_ints[body], arrays.machine
    if ints[c.I_KIND] >= c.IDM:
        mine[c.B_TIMER] += dt_s
    _limit_controls(arrays, body)
    speed = mine[c.B_SPEED]
    slip = arctan(machine, 1 / 2 * tan(machine, mine[c.B_STEERING]))
    course = mine[c.B_HEADING] + slip
    mine[c.B_X] += speed * cos(machine, course) * dt_s
    mine[c.B_Y] += speed * sin(machine, course) * dt_s
    if ints[c.I_HAS_IMPACT]:
        mine[c.B_X] += mine[c.B_IMPACT_X]
        mine[c.B_Y] += mine[c.B_IMPACT_Y]
        ints[c.I_CRASHED], ints[c.I_HAS_IMPACT] = 1, 0
    mine[c.B_HEADING] += speed * sin(machine, slip) / (mine[c.P_LENGTH] / 2) * dt_s
    mine[c.B_SPEED] += mine[c.B_ACCELERATION] * dt_s
    face(arrays, body)
    ints[c.I_LANE] = locate(arrays, body)
