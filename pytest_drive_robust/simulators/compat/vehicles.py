"""highway-env's vehicles and objects as rows, and rows back into them."""

from __future__ import annotations

from typing import Any

import numpy as np

from pytest_drive_robust.simulators.compat import columns as c
from pytest_drive_robust.simulators.compat.network import Network

__all__ = ["read_body", "read_parameters", "write_body"]

# column of `bodies` -> attribute of a vehicle of that kind or above
_PARAMETERS: dict[int, tuple[tuple[int, str], ...]] = {
    c.PLAIN: ((c.P_MAX_SPEED, "MAX_SPEED"), (c.P_MIN_SPEED, "MIN_SPEED")),
    c.CONTROLLED: (
        (c.P_TAU_PURSUIT, "TAU_PURSUIT"),
        (c.P_KP_A, "KP_A"),
        (c.P_KP_HEADING, "KP_HEADING"),
        (c.P_KP_LATERAL, "KP_LATERAL"),
        (c.P_MAX_STEERING, "MAX_STEERING_ANGLE"),
        (c.P_DELTA_SPEED, "DELTA_SPEED"),
    ),
    c.IDM: (
        (c.P_ACC_MAX, "ACC_MAX"),
        (c.P_COMFORT_ACC_MAX, "COMFORT_ACC_MAX"),
        (c.P_COMFORT_ACC_MIN, "COMFORT_ACC_MIN"),
        (c.P_DISTANCE_WANTED, "DISTANCE_WANTED"),
        (c.P_TIME_WANTED, "TIME_WANTED"),
        (c.P_DELTA, "DELTA"),
        (c.P_POLITENESS, "POLITENESS"),
        (c.P_MIN_GAIN, "LANE_CHANGE_MIN_ACC_GAIN"),
        (c.P_MAX_BRAKING_IMPOSED, "LANE_CHANGE_MAX_BRAKING_IMPOSED"),
        (c.P_CHANGE_DELAY, "LANE_CHANGE_DELAY"),
    ),
}


def read_parameters(body: Any, kind: int, row: c.Floats) -> None:
    """Enter sizes and driver parameters, of the instance where it has its own."""
    row[[c.P_LENGTH, c.P_WIDTH, c.P_DIAGONAL]], row[c.P_SQUARE] = (body.LENGTH, body.WIDTH, body.diagonal), 2.0
    for least, entries in _PARAMETERS.items():
        if kind >= least:
            for column, name in entries:
                row[column] = getattr(body, name)
    if kind == c.LINEAR:
        row[c.P_ACCELERATION : c.P_ACCELERATION + 3] = body.ACCELERATION_PARAMETERS
        row[c.P_STEERING : c.P_STEERING + 2] = body.STEERING_PARAMETERS


def read_body(body: Any, kind: int, network: Network, *, floats: c.Floats, ints: c.Ints) -> None:
    """Enter the state of a vehicle or object into its two rows; routes and target speeds are the caller's."""
    floats[[c.B_X, c.B_Y]], floats[c.B_HEADING], floats[c.B_SPEED] = body.position, body.heading, body.speed
    ints[c.I_KIND], ints[c.I_LANE] = kind, network.lane(body.lane_index)
    ints[[c.I_CRASHED, c.I_HIT]] = body.crashed, body.hit
    ints[[c.I_SOLID, c.I_COLLIDABLE, c.I_CHECKS]] = body.solid, body.collidable, body.check_collisions
    if kind < c.PLAIN:
        return
    floats[c.B_ACCELERATION], floats[c.B_STEERING] = body.action["acceleration"], body.action["steering"]
    if body.impact is not None:
        ints[c.I_HAS_IMPACT] = 1
        floats[[c.B_IMPACT_X, c.B_IMPACT_Y]] = body.impact
    if kind >= c.CONTROLLED:
        ints[c.I_TARGET_LANE], floats[c.B_TARGET_SPEED] = network.lane(body.target_lane_index), body.target_speed
    if kind == c.MDP:
        ints[c.I_SPEED_INDEX] = body.speed_index
    if kind >= c.IDM:
        floats[c.B_TIMER], ints[c.I_CHANGES_LANE] = body.timer, bool(body.enable_lane_change)


def write_body(body: Any, network: Network, *, floats: c.Floats, ints: c.Ints) -> None:
    """The two rows back into a live vehicle or object."""
    body.crashed, body.hit = bool(ints[c.I_CRASHED]), bool(ints[c.I_HIT])
    if ints[c.I_KIND] < c.PLAIN:
        return
    body.position[:] = floats[[c.B_X, c.B_Y]]
    body.heading, body.speed = float(floats[c.B_HEADING]), float(floats[c.B_SPEED])
    body.action = {"steering": float(floats[c.B_STEERING]), "acceleration": float(floats[c.B_ACCELERATION])}
    body.impact = np.array(floats[[c.B_IMPACT_X, c.B_IMPACT_Y]]) if ints[c.I_HAS_IMPACT] else None
    body.lane_index, body.lane = network.indices[ints[c.I_LANE]], network.lanes[ints[c.I_LANE]]
    if ints[c.I_KIND] >= c.CONTROLLED:
        body.target_lane_index = network.indices[ints[c.I_TARGET_LANE]]
        body.target_speed = float(floats[c.B_TARGET_SPEED])
    if ints[c.I_KIND] == c.MDP:
        body.speed_index = int(ints[c.I_SPEED_INDEX])
    if ints[c.I_KIND] >= c.IDM:
        body.timer = float(floats[c.B_TIMER])
