"""Draw a junction at the gap in the waypoints: arms, the ways between arms, lights or signs."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pytest_drive_robust.arithmetic import scalars
from pytest_drive_robust.domain.truth import LaneKind
from pytest_drive_robust.errors import RouteError
from pytest_drive_robust.jit.arrays import Floats
from pytest_drive_robust.simulators.embedded.geometry import arc_lengths, moved
from pytest_drive_robust.simulators.embedded.towns.junction import control_of, crosswalk
from pytest_drive_robust.simulators.embedded.towns.pieces import PLAIN
from pytest_drive_robust.simulators.embedded.towns.town import Arm, DrawnLane, Section, Town
from pytest_drive_robust.simulators.embedded.traced import lines
from pytest_drive_robust.simulators.embedded.traced.course import RouteCourse
from pytest_drive_robust.simulators.embedded.traced.open_roads import LANE_M, trace_road
from pytest_drive_robust.simulators.embedded.traced.schema import Roads

_ARM_M = 120.0
_BIKING_M = 1.6
_BOX_M = (9.5, 16.0)
_SMALLEST_M = 7.0
_TURN_RAD = math.radians(45.0)
_TRIGGER_BEFORE_M = 9.5
"""Distance of the scenario's start before the junction: 5 m to the stop line, and the front half of the ego."""
_WINDOW_M = 30


@dataclass(frozen=True, slots=True)
class _Ways:
    """The ego's lane before and after the junction, and the middle of the junction, on the dividers of its roads."""

    before: Floats
    after: Floats
    centre: tuple[float, float]
    across_rad: tuple[float, float]
    """Headings of the two other arms, away from the middle; the left arm first when the ego goes straight on."""


def draw_junction(town: Town, course: RouteCourse, roads: Roads, trigger_m: float) -> tuple[Floats, float]:
    """Draw the junction; return the ego's way and the latest start of the scenario, in metres along that way."""
    if course.after is None:
        course = _cut_out(course, trigger_m)
    ways = _turning(course, trigger_m) or _straight_on(course, trigger_m)
    arms = _arms(ways, roads)
    for arm, line in arms:
        trace_road(town, arm.name, line, arm.section)
        crosswalk(town, arm)
    inside = _connect(town, [arm for arm, _ in arms], roads)
    entry_m = float(arc_lengths(ways.before)[-1])
    return lines.joined(ways.before, inside[1:-1], ways.after), max(entry_m - _TRIGGER_BEFORE_M, 0.0)


def _cut_out(course: RouteCourse, trigger_m: float) -> RouteCourse:
    """Cut a junction out of a course without a gap: at the sharpest bend after the trigger, else 40 m after it."""
    line = course.before
    first, last = round(trigger_m) + 12, len(line) - 12
    if last - first <= _WINDOW_M:
        raise RouteError(
            f"{len(line)} m with the trigger at {trigger_m:.0f} m leave no room for a junction, expected more than "
            f"{_WINDOW_M + 24} m behind it"
        )
    turns = np.abs(line[first + _WINDOW_M : last, 2] - line[first : last - _WINDOW_M, 2])
    k = int(np.argmax(turns))
    start = first + k if turns[k] > _TURN_RAD else min(round(trigger_m) + 28, last - _WINDOW_M)
    return RouteCourse(line[: start + 1], line[start + _WINDOW_M :], ())


def _turning(course: RouteCourse, trigger_m: float) -> _Ways | None:
    """Return a junction where the ego turns, at the corner of its two lanes; None when the lanes do not meet."""
    before, after = course.before, course.after
    assert after is not None
    start, end = tuple(before[-1]), tuple(after[0])
    turn = math.remainder(end[2] - start[2], math.tau)
    corner = lines.crossing_point(start, end)
    if corner is None or not _TURN_RAD < abs(turn) < math.pi - _TURN_RAD or min(corner) < 4.0:
        return None
    room = corner[0] - (trigger_m + _TRIGGER_BEFORE_M - course.start_m)
    least = min(max(course.start_m + corner[0] - _TRIGGER_BEFORE_M - 0.5, _SMALLEST_M), _BOX_M[0])
    box = min(max(min(*corner, room, _BOX_M[1]), least), max(min(corner), _SMALLEST_M))
    entry = lines.prolonged(before, after_m=corner[0] - box) if corner[0] > box else before
    leave = lines.prolonged(after, before_m=corner[1] - box) if corner[1] > box else after
    own, onward = moved(tuple(entry[-1]), 0.0, -LANE_M / 2.0), moved(tuple(leave[0]), 0.0, -LANE_M / 2.0)
    middle = lines.crossing_point(own, onward)
    assert middle is not None
    centre = moved(own, middle[0])[:2]
    return _Ways(entry, leave, centre, (own[2], onward[2] + math.pi))


def _straight_on(course: RouteCourse, trigger_m: float) -> _Ways:
    """Place a junction straight ahead: in the middle of where waypoints lack, or as far on as the trigger needs."""
    line, s = course.whole(), arc_lengths(course.whole())
    box = min(max(course.gap_m / 2.0 - 1.0, _BOX_M[0]), _BOX_M[1])
    entry_m = max(course.start_m + course.gap_m / 2.0 - box, trigger_m + _TRIGGER_BEFORE_M)
    entry_m = min(entry_m, course.start_m + max(course.gap_m - box, 1.0), s[-1] - 2.0 * box - 5.0)
    if entry_m < 3.0:
        raise RouteError(f"{s[-1]:.0f} m are too short for a junction on them")
    first, last = (int(np.searchsorted(s, at)) for at in (entry_m, entry_m + 2.0 * box))
    middle = line[(first + last) // 2]
    centre = moved(tuple(middle), 0.0, -LANE_M / 2.0)[:2]
    quarter = math.pi / 2.0
    return _Ways(line[: first + 1], line[last:], centre, (middle[2] - quarter, middle[2] + quarter))


def _arms(ways: _Ways, roads: Roads) -> list[tuple[Arm, Floats]]:
    """Return (arm, divider line away from the junction) of the ego's way in, its way out, and the other arms."""
    plain = Section(1, 1, LANE_M, roads.speed_mps)
    own = Section(1, 1, LANE_M, roads.speed_mps, biking_m=_BIKING_M if roads.biking else 0.0)
    entry = lines.reversed_line(lines.shifted(lines.prolonged(ways.before, before_m=_ARM_M), -LANE_M / 2.0))
    leave = lines.shifted(lines.prolonged(ways.after, after_m=_ARM_M), -LANE_M / 2.0)
    turns = abs(math.remainder(leave[0, 2] - entry[0, 2] - math.pi, math.tau)) > _TURN_RAD
    arms = [_arm("in", entry, ways.centre, own), _arm("out", leave, ways.centre, plain if turns else own)]
    others = [("ahead", ways.across_rad[0], own), ("back", ways.across_rad[1], plain)]
    if not turns:
        others = [("left", ways.across_rad[0], plain), ("right", ways.across_rad[1], plain)]
    for (name, heading, section), like in zip(others, tuple(arms), strict=True):
        box = like[0].box_m if turns else max(arms[0][0].box_m, arms[1][0].box_m)
        edge = moved((*ways.centre, heading), box)
        arms.append(_arm(name, lines.straight(edge, _ARM_M), ways.centre, section))
    return arms if roads.arms == 4 else [*arms[:2], arms[3]]


def _arm(name: str, line: Floats, centre: tuple[float, float], section: Section) -> tuple[Arm, Floats]:
    """Make an arm whose centre lies straight behind its edge."""
    x, y, heading = (float(value) for value in line[0])
    box = scalars.hypot(x - centre[0], y - centre[1])
    return Arm(name, heading, box, section, moved((x, y, heading), -box)[:2]), line


def _connect(town: Town, arms: list[Arm], roads: Roads) -> Floats:
    """Connect all pairs of arms; return the line of the ego's way through the junction."""
    junction = town.new_junction()
    own: Floats | None = None
    for source in arms:
        into = town.chains[source.inward("0")][-1]
        for target in arms:
            if target is not source:
                lane = _way(town, source, target, "0", junction=junction)
                own = lane.centre if own is None else own
        if roads.control is not None:
            town.controls.append(control_of(source, into, roads.control))
    biking = [arm for arm in arms if arm.section.biking_m]
    for source in biking:
        for target in biking:
            if target is not source:
                _way(town, source, target, "bike", junction=junction)
    assert own is not None
    return own


def _way(town: Town, source: Arm, target: Arm, lane: str, *, junction: int) -> DrawnLane:
    first, last = (town.lanes[k] for k in (town.chains[source.inward(lane)][-1], town.chains[target.outward(lane)][0]))
    centre = lines.bridge(tuple(first.centre[-1]), tuple(last.centre[0]))
    speed_mps = min(first.speed_mps, last.speed_mps)
    kind = LaneKind.DRIVING if lane == "0" else LaneKind.BIKING
    drawn = DrawnLane(centre, float(arc_lengths(centre)[-1]), first.width_m, PLAIN, speed_mps, kind, junction)
    town.add(drawn)
    return drawn
