"""Roads without a junction: lanes beside the ego's own along its whole way."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pytest_drive_robust.arithmetic import arrays
from pytest_drive_robust.arithmetic.signals import mean
from pytest_drive_robust.simulators.embedded.geometry import arc_lengths
from pytest_drive_robust.simulators.embedded.towns.town import Section, Town
from pytest_drive_robust.simulators.embedded.traced.course import RouteCourse, Shift
from pytest_drive_robust.simulators.embedded.traced.lines import prolonged, shifted
from pytest_drive_robust.simulators.embedded.traced.schema import Roads
from pytest_drive_robust.simulators.embedded.traced.trace_road import trace_road

__all__ = ["LANE_M", "draw_street"]

Floats = NDArray[np.float64]
LANE_M = 3.5
_BEYOND_M = 130.0
_CHANGE_M = 24.0


def draw_street(town: Town, course: RouteCourse, roads: Roads, direction: str | None) -> Floats:
    """Draw the road; return the ego's way on it, with lane changes where the waypoints jump."""
    line = course.whole()
    roads = _for_direction(roads, direction, course.shifts)
    width = mean([abs(shift.right_m) for shift in course.shifts]) if course.shifts else LANE_M
    left_kerb = roads.parking and direction == "left"
    backward = 0 if left_kerb or not roads.two_ways else roads.lanes
    section = Section(
        roads.lanes, backward, width, roads.speed_mps,
        parking=roads.parking, sidewalk=roads.two_ways, left_walk=left_kerb, left_parking=left_kerb,
    )  # fmt: skip
    long = prolonged(line, before_m=_BEYOND_M, after_m=_BEYOND_M)
    trace_road(town, "road", shifted(long, -(roads.own + 0.5) * width), section)
    if not roads.two_ways:
        town.building_gap_m = (8.0, 30.0)
    return _with_changes(line, course.shifts, width)


def _for_direction(roads: Roads, direction: str | None, shifts: tuple[Shift, ...]) -> Roads:
    """Return `roads` with the ego at the other edge of its way where something happens to the left, not the right.

    Lane changes need lanes: as many to either side as the route goes there, and one more where it never goes.
    """
    if shifts:
        at = np.cumsum([0.0, *(np.sign(shift.right_m) for shift in shifts)])
        left, right = int(-at.min()), int(at.max())
        lanes = max(left + right + 1, roads.lanes)
        return replace(roads, lanes=lanes, own=max(left, lanes - 1 - right if right else left))
    if direction == "left" and roads.lanes > 1:
        return replace(roads, own=roads.lanes - 1 - roads.own)
    return roads


def _with_changes(line: Floats, shifts: tuple[Shift, ...], width_m: float) -> Floats:
    s = arc_lengths(line)
    right = np.zeros(len(line))
    for shift in shifts:
        share = np.clip((s - shift.at_m) / _CHANGE_M + 0.5, 0.0, 1.0)
        right += np.sign(shift.right_m) * width_m * (0.5 - 0.5 * arrays.cos(np.pi * share))
    return shifted(line, right) if shifts else line
