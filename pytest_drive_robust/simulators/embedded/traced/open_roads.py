"""Draw roads along given lines, and roads without a junction: lanes beside the ego's lane along its whole way."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from pytest_drive_robust.arithmetic import arrays
from pytest_drive_robust.arithmetic.signals import mean
from pytest_drive_robust.errors import RouteError
from pytest_drive_robust.jit.arrays import Floats
from pytest_drive_robust.simulators.embedded.geometry import arc_lengths, resample
from pytest_drive_robust.simulators.embedded.towns.pieces import draw_strips
from pytest_drive_robust.simulators.embedded.towns.town import DrawnLane, Section, Town
from pytest_drive_robust.simulators.embedded.traced.course import RouteCourse, Shift
from pytest_drive_robust.simulators.embedded.traced.lines import prolonged, reversed_line, shifted
from pytest_drive_robust.simulators.embedded.traced.schema import Roads

LANE_M = 3.5
_BEYOND_M = 130.0
_CHANGE_M = 24.0


def trace_road(town: Town, name: str, line: Floats, section: Section) -> None:
    """Draw a road whose divider (of a one-way road: left edge) is `line`; chains are named as by `pieces.road`.

    Raises `RouteError` where the line bends so tightly that a lane beside it would turn back on itself.
    """

    def curve(offset: float, *, backward: bool, **lane: Any) -> DrawnLane:
        beside = shifted(line, offset)
        along = arrays.cos(line[:-1, 2]) * np.diff(beside[:, 0]) + arrays.sin(line[:-1, 2]) * np.diff(beside[:, 1])
        if (along <= 0.0).any():
            raise RouteError(f"its road bends so tightly that no lane fits {abs(offset):.1f} m beside its middle")
        if backward:
            beside = reversed_line(beside)
        centre = resample(beside)
        centre[0, 2], centre[-1, 2] = beside[0, 2], beside[-1, 2]
        return DrawnLane(centre, float(arc_lengths(centre)[-1]), **lane)

    draw_strips(town, name, curve, section)


def draw_street(town: Town, course: RouteCourse, roads: Roads, direction: str | None) -> Floats:
    """Draw a road without a junction; return the ego's way on it, with lane changes where the waypoints jump."""
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
    """Return `roads` with the ego's lane on the other side when the scenario is to the left.

    With lane changes, the road gets as many lanes to either side as the route changes to that side.
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
