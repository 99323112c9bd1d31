"""What a policy tells a controlled vehicle: the meta actions of highway-env."""

from __future__ import annotations

import numpy as np

from pytest_drive_robust.simulators.compat import columns as c
from pytest_drive_robust.simulators.compat.columns import Arrays
from pytest_drive_robust.simulators.compat.compiled import kernel, part
from pytest_drive_robust.simulators.compat.drivers import control
from pytest_drive_robust.simulators.compat.graph import follow_road
from pytest_drive_robust.simulators.compat.lanes import is_reachable

__all__ = ["tell"]


@part
def _step_speed(arrays: Arrays, body: int, change: int, speeds: c.Floats) -> None:
    """Aim at the next higher (+1) or lower (-1) of the target speeds of an MDP vehicle."""
    count = len(speeds)
    share = (arrays.bodies[body, c.B_SPEED] - speeds[0]) / (speeds[count - 1] - speeds[0])
    index = int(min(max(np.rint(share * (count - 1)), 0.0), count - 1.0)) + change
    index = min(max(index, 0), count - 1)
    arrays.body_ints[body, c.I_SPEED_INDEX], arrays.bodies[body, c.B_TARGET_SPEED] = index, speeds[index]


@part
def _aim_beside(arrays: Arrays, body: int, side: int) -> None:
    target = arrays.body_ints[body, c.I_TARGET_LANE]
    edge = arrays.edges[arrays.lane_ints[target, c.LI_EDGE]]
    place = min(max(arrays.lane_ints[target, c.LI_ID] + side, 0), edge[c.E_COUNT] - 1)
    if is_reachable(arrays, edge[c.E_FIRST] + place, body):
        arrays.body_ints[body, c.I_TARGET_LANE] = edge[c.E_FIRST] + place


@kernel
def tell(arrays: Arrays, body: int, told: int, speeds: c.Floats) -> None:
    """`vehicle.act(action)` of a controlled vehicle, before everybody acts; `speeds`: the choices of an MDP vehicle."""
    kind = arrays.body_ints[body, c.I_KIND]
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
    control(arrays, body)
