"""Geometry of lanes: position, heading and local coordinates, computed in highway-env's order of operations."""

from __future__ import annotations

import math

from pytest_drive_robust.simulators.compat import columns as c
from pytest_drive_robust.simulators.compat.arithmetic import arctan, arctan2, cos, dot2, sin
from pytest_drive_robust.simulators.compat.columns import Arrays
from pytest_drive_robust.simulators.compat.compiled import inline_part, part

__all__ = ["along", "centre_point", "coordinates", "distance", "heading_at", "is_on", "is_reachable", "locate", "wrap"]


@inline_part
def wrap(x: float) -> float:
    """An angle in [-pi, pi)."""
    return ((x + math.pi) % (2 * math.pi)) - math.pi


@inline_part
def _bearing(arrays: Arrays, number: int, x: float, y: float) -> float:
    return float(arctan2(arrays.machine, y - arrays.lanes[number, c.L_Y], x - arrays.lanes[number, c.L_X]))


@inline_part
def _circle_along(arrays: Arrays, number: int, bearing: float) -> float:
    start, turn = arrays.lanes[number, c.L_START_PHASE], arrays.lanes[number, c.L_TURN]
    phase = start + wrap(bearing - start)
    return float(turn * (phase - start) * arrays.lanes[number, c.L_RADIUS])


@inline_part
def _circle_across(arrays: Arrays, number: int, x: float, y: float) -> float:
    dx, dy = x - arrays.lanes[number, c.L_X], y - arrays.lanes[number, c.L_Y]
    radius = math.sqrt(dot2(arrays.machine, dx, dy, dx, dy))
    return float(arrays.lanes[number, c.L_TURN] * (arrays.lanes[number, c.L_RADIUS] - radius))


@inline_part
def coordinates(arrays: Arrays, number: int, x: float, y: float) -> tuple[float, float]:
    """Longitudinal and lateral lane coordinate of a point [m]."""
    kind, lanes = arrays.lane_ints[number, c.LI_KIND], arrays.lanes
    if kind == c.CIRCLE:
        return _circle_along(arrays, number, _bearing(arrays, number, x, y)), _circle_across(arrays, number, x, y)
    dx, dy = x - lanes[number, c.L_X], y - lanes[number, c.L_Y]
    s = dot2(arrays.machine, dx, dy, lanes[number, c.L_ALONG_X], lanes[number, c.L_ALONG_Y])
    lateral = dot2(arrays.machine, dx, dy, lanes[number, c.L_RIGHT_X], lanes[number, c.L_RIGHT_Y])
    if kind == c.SINE:
        phase = lanes[number, c.L_PULSATION] * s + lanes[number, c.L_PHASE]
        lateral -= lanes[number, c.L_AMPLITUDE] * sin(arrays.machine, phase)
    return s, lateral


@part
def centre_point(arrays: Arrays, number: int, s: float) -> tuple[float, float]:
    """The point `s` metres along the middle of a lane."""
    lane, machine, kind = arrays.lanes[number], arrays.machine, arrays.lane_ints[number, c.LI_KIND]
    if kind == c.CIRCLE:
        phase = lane[c.L_TURN] * s / lane[c.L_RADIUS] + lane[c.L_START_PHASE]
        radius = lane[c.L_RADIUS]
        return lane[c.L_X] + radius * cos(machine, phase), lane[c.L_Y] + radius * sin(machine, phase)
    lateral = 0.0
    if kind == c.SINE:
        lateral = 0.0 + lane[c.L_AMPLITUDE] * sin(machine, lane[c.L_PULSATION] * s + lane[c.L_PHASE])
    return (
        lane[c.L_X] + s * lane[c.L_ALONG_X] + lateral * lane[c.L_RIGHT_X],
        lane[c.L_Y] + s * lane[c.L_ALONG_Y] + lateral * lane[c.L_RIGHT_Y],
    )


@inline_part
def heading_at(arrays: Arrays, number: int, s: float) -> float:
    """Heading of a lane [rad], not normalised."""
    kind, lanes = arrays.lane_ints[number, c.LI_KIND], arrays.lanes
    if kind == c.CIRCLE:
        phase = lanes[number, c.L_TURN] * s / lanes[number, c.L_RADIUS] + lanes[number, c.L_START_PHASE]
        return float(phase + math.pi / 2 * lanes[number, c.L_TURN])
    if kind == c.SINE:
        slope = cos(arrays.machine, lanes[number, c.L_PULSATION] * s + lanes[number, c.L_PHASE])
        slope = lanes[number, c.L_AMPLITUDE] * lanes[number, c.L_PULSATION] * slope
        return float(lanes[number, c.L_HEADING] + arctan(arrays.machine, slope))
    return float(lanes[number, c.L_HEADING])


@part
def _late_along(arrays: Arrays, number: int, body: int) -> float:
    bearing = _bearing(arrays, number, arrays.bodies[body, c.B_X], arrays.bodies[body, c.B_Y])
    s = _circle_along(arrays, number, bearing)
    arrays.coordinates[c.ALONG, number, body] = s
    return s


@inline_part
def along(arrays: Arrays, number: int, body: int) -> float:
    """Longitudinal coordinate of a body on a lane [m]; on circles computed only when somebody asks."""
    s = arrays.coordinates[c.ALONG, number, body]
    return _late_along(arrays, number, body) if math.isnan(s) else s


@inline_part
def distance(arrays: Arrays, number: int, s: float, lateral: float) -> float:
    """L1 distance of lane coordinates to the lane [m]."""
    return float(abs(lateral) + max(s - arrays.lanes[number, c.L_LENGTH], 0.0) + max(0.0 - s, 0.0))


@inline_part
def is_on(arrays: Arrays, number: int, body: int, margin_m: float) -> bool:
    """Whether a body is on a lane that is `margin_m` wider on both sides and a vehicle longer at both ends."""
    if not abs(arrays.coordinates[c.ACROSS, number, body]) <= arrays.lanes[number, c.L_WIDTH] / 2 + margin_m:
        return False
    s, margin = along(arrays, number, body), arrays.lanes[number, c.L_MARGIN]
    return bool(-margin <= s < arrays.lanes[number, c.L_LENGTH] + margin)


@part
def is_reachable(arrays: Arrays, number: int, body: int) -> bool:
    """Whether a body may change to a lane."""
    width = arrays.lanes[number, c.L_WIDTH]
    if arrays.lane_ints[number, c.LI_FORBIDDEN] or not abs(arrays.coordinates[c.ACROSS, number, body]) <= 2 * width:
        return False
    return bool(0 <= along(arrays, number, body) < arrays.lanes[number, c.L_LENGTH] + arrays.lanes[number, c.L_MARGIN])


@part
def locate(arrays: Arrays, body: int) -> int:
    """Enter a body's lane coordinates into the tables; the number of the lane closest in position and heading.

    On a circle the longitudinal coordinate costs an arctan2: it is left for later (nan) where the lateral distance
    alone is beyond the best lane so far, and used again for the next lane around the same centre.
    """
    x, y, heading = arrays.bodies[body, c.B_X], arrays.bodies[body, c.B_Y], arrays.bodies[body, c.B_HEADING]
    closest, best = 0, math.inf
    centre_x, centre_y, bearing = math.nan, math.nan, 0.0
    for number in range(arrays.lanes.shape[0]):
        if arrays.lane_ints[number, c.LI_KIND] == c.CIRCLE:
            s, lateral = math.nan, _circle_across(arrays, number, x, y)
            if abs(lateral) < best:
                if arrays.lanes[number, c.L_X] != centre_x or arrays.lanes[number, c.L_Y] != centre_y:
                    centre_x, centre_y = arrays.lanes[number, c.L_X], arrays.lanes[number, c.L_Y]
                    bearing = _bearing(arrays, number, x, y)
                s = _circle_along(arrays, number, bearing)
        else:
            s, lateral = coordinates(arrays, number, x, y)
        arrays.coordinates[c.ALONG, number, body], arrays.coordinates[c.ACROSS, number, body] = s, lateral
        if abs(lateral) < best:
            angle = abs(wrap(heading - heading_at(arrays, number, s)))
            far = distance(arrays, number, s, lateral) + 1.0 * angle
            if far < best:
                closest, best = number, far
    return closest
