"""Draw country roads and motorways where the ego exits or enters, or another car enters beside the ego."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np

from pytest_drive_robust.arithmetic import arrays, scalars
from pytest_drive_robust.arithmetic.signals import moving_sum
from pytest_drive_robust.domain.route import ScenarioSpec
from pytest_drive_robust.errors import RouteError
from pytest_drive_robust.jit.arrays import Floats
from pytest_drive_robust.simulators.embedded.geometry import arc_lengths, moved, place, project, seen_from
from pytest_drive_robust.simulators.embedded.towns.town import Section, Town
from pytest_drive_robust.simulators.embedded.traced.course import RouteCourse
from pytest_drive_robust.simulators.embedded.traced.lines import bridge, joined, prolonged, shifted
from pytest_drive_robust.simulators.embedded.traced.open_roads import LANE_M, trace_road
from pytest_drive_robust.simulators.embedded.traced.schema import Roads
from pytest_drive_robust.simulators.embedded.weave import change_length_m

_BEYOND_M = 160.0
"""Roads go on this far beyond the route."""
_BEHIND_M = 120.0
"""Roads begin this far behind it."""
_LEAST_CHANGE_M, _MOST_CHANGE_M = 12.0, 45.0
"""Length of a lane change before an exit or behind an entry."""
_SLOW_GAP_M = 80.0
"""With a shorter stretch without waypoints the road is a slow one, of `_SLOW_MPS`."""
_SLOW_MPS, _RAMP_MPS, _LEAST_MPS = 14.0, 14.0, 7.0
"""Speed limits: of a slow road, and the highest and the lowest of a ramp."""
_SIDEWAYS_MPS2 = 3.0
"""Acceleration to the side in the sharpest bend of a ramp, at its limit."""
_SHARPEST = 1.0 / 50.0
"""Curvature (1/m) of the sharpest road beside an exit."""
_PARALLEL_M = (50.0, 90.0)
"""Shortest and longest acceleration lane."""
_BACK_TO_FLOW_M = 45.0
"""Straight road before the place where the ego enters."""
_LEAST_GAP_M = 40.0
"""Shortest stretch without waypoints in which roads can part or meet."""


def draw_exit(town: Town, course: RouteCourse, roads: Roads, spec: ScenarioSpec, trigger_m: float) -> Floats:
    """Draw a road with the flow's lane beside the ego's lane on the side of the exit, and a ramp; return the ego's way.

    The road continues to the flow's end when the file puts this end off the ramp.
    """
    before, after = _parts(course, spec)
    gap, start = course.gap_m, course.start_m + _BEHIND_M
    own = _road_on(before, after, spec, gap)
    side = 1.0 if project(own, *after[0, :2])[1] > 0.0 else -1.0
    limit = roads.speed_mps if gap >= _SLOW_GAP_M else _SLOW_MPS
    # leave room for the lane change before the ramp begins, and for the ramp to part from the road
    begins = _BEHIND_M + trigger_m + 1.0
    fork = min(max(start + 0.35 * gap, begins + _over_m(limit) + 2.0), start + 0.55 * gap)
    over = min(_over_m(limit), fork - begins)
    if over < _LEAST_CHANGE_M:
        raise RouteError(f"{fork - begins:.0f} m from the trigger to the exit are too few to change lanes")
    target = shifted(own, side * LANE_M)
    ramp_start = place(target, project(target, *place(own, fork)[:2])[0])
    ramp = joined(bridge(ramp_start, tuple(after[0])), after[1:])
    _road(town, own, limit, (fork,), lanes=((3, 1), (3, 1)))
    section = Section(1, 0, LANE_M, _ramp_speed(ramp), sidewalk=False)
    trace_road(town, "exit", shifted(prolonged(ramp, after_m=_BEYOND_M), -LANE_M / 2.0), section)
    s = arc_lengths(own)
    changing = shifted(own, side * LANE_M * (1.0 - _still_to_go(s, begins, over)))
    return joined(changing[(s > _BEHIND_M - 0.5) & (s < fork - 0.5)], ramp)


def draw_entry(town: Town, course: RouteCourse, roads: Roads, spec: ScenarioSpec) -> Floats:
    """Draw the flow's lane, an acceleration lane beside it, and a ramp to the acceleration lane; return the ego's way.

    The ego enters over the ramp and ends in the flow's lane.
    """
    before, after = _parts(course, spec)
    gap = course.gap_m
    main = _flow_road(after, spec)
    joint = project(main, *after[0, :2])[0]
    side = 1.0 if seen_from(tuple(after[0]), before[-1])[1] > 0.0 else -1.0
    parallel = min(max(0.6 * gap, _PARALLEL_M[0]), _PARALLEL_M[1], 0.85 * gap)
    limit = roads.speed_mps if gap >= _SLOW_GAP_M else _SLOW_MPS
    begins = joint - parallel
    beside = shifted(main, side * LANE_M)
    ramp = joined(before, bridge(tuple(before[-1]), place(beside, begins))[1:])
    _road(town, main, limit, (begins, begins + (parallel + 15.0)), lanes=_with_lane_between(side))
    section = Section(1, 0, LANE_M, _ramp_speed(ramp), sidewalk=False)
    trace_road(town, "ramp", shifted(prolonged(ramp, before_m=_BEHIND_M), -LANE_M / 2.0), section)
    over = min(_over_m(limit), parallel - 8.0)
    from_m = begins + min(12.0, parallel - over - 4.0)
    s = arc_lengths(main)
    back = shifted(main, side * LANE_M * _still_to_go(s, from_m, over))
    end = joint + float(arc_lengths(after)[-1])
    return joined(ramp, back[(s > begins + 0.5) & (s <= end)])


def draw_cut_in(town: Town, course: RouteCourse, roads: Roads, spec: ScenarioSpec) -> Floats:
    """Draw the ego's lane straight on, and beside it a lane that comes from a ramp and ends; return the ego's way."""
    line = course.whole()
    other = spec.parameters["other_actor_location"]
    side = 1.0 if project(line, other["x"], other["y"])[1] > 0.0 else -1.0
    whole = prolonged(line, before_m=_BEHIND_M, after_m=_BEYOND_M)
    begins = _BEHIND_M - 30.0
    parallel = _BEHIND_M + course.start_m + max(course.gap_m, _LEAST_GAP_M) - begins
    _road(town, whole, roads.speed_mps, (begins, begins + parallel), lanes=_with_lane_between(side))
    joint = place(shifted(whole, side * LANE_M), begins)
    away = moved(joint, -90.0, side * 14.0)
    start = away[0], away[1], joint[2] - side * 0.25
    ramp = joined(bridge(start, joint))
    section = Section(1, 0, LANE_M, _ramp_speed(ramp), sidewalk=False)
    trace_road(town, "ramp", shifted(prolonged(ramp, before_m=40.0), -LANE_M / 2.0), section)
    return line


def _parts(course: RouteCourse, spec: ScenarioSpec) -> tuple[Floats, Floats]:
    if course.after is None or course.gap_m < _LEAST_GAP_M:
        raise RouteError(
            f"scenario {spec.type} needs a stretch of {_LEAST_GAP_M:.0f} m or more without waypoints, where its roads "
            f"part or meet; the longest is {course.gap_m:.0f} m"
        )
    return course.before, course.after


def _road_on(before: Floats, after: Floats, spec: ScenarioSpec, gap_m: float) -> Floats:
    """Return the ego's lane from before the route to far behind the exit: an arc beside the flow's end, or straight."""
    start, flow_end = tuple(before[-1]), _point(spec, "end_actor_flow")
    curvature = 0.0
    ahead, right = seen_from(start, flow_end)
    beyond, beside = seen_from(tuple(after[0]), flow_end)
    on_ramp = scalars.hypot(beyond, beside) < 1.5 * LANE_M or abs(beside) < LANE_M / 2.0
    if not on_ramp and ahead > 20.0:
        # the flow's lane is the next lane on the side of the exit
        right += LANE_M * (1.0 if right > seen_from(start, after[0])[1] else -1.0)
        curvature = 2.0 * right / (ahead * ahead + right * right)
        curvature = 0.0 if abs(right) < LANE_M / 2.0 else float(np.clip(curvature, -_SHARPEST, _SHARPEST))
    steps = np.arange(1.0, gap_m + 30.0)
    heading = start[2] + curvature * steps
    x, y = start[0] + np.cumsum(arrays.cos(heading)), start[1] + np.cumsum(arrays.sin(heading))
    arc = np.column_stack([x, y, heading])
    return prolonged(joined(before, arc), before_m=_BEHIND_M, after_m=_BEYOND_M)


def _flow_road(after: Floats, spec: ScenarioSpec) -> Floats:
    """Return the lane in which the route ends, prolonged back to the flow's start if that lies far enough behind."""
    joint = tuple(after[0])
    back = moved(joint, -_BACK_TO_FLOW_M)
    straight_on = prolonged(after, before_m=_BACK_TO_FLOW_M, after_m=_BEYOND_M)
    flow = _point(spec, "start_actor_flow")
    ahead, right = seen_from(back, flow)
    if ahead > -30.0 or abs(right) > -0.8 * ahead or abs(right) < 1.5 * LANE_M:
        return prolonged(straight_on, before_m=_BEHIND_M)
    chord = scalars.atan2(-right, -ahead)
    start = (*flow, back[2] + 2.0 * chord)
    return prolonged(joined(bridge(start, back)[:-1], straight_on), before_m=_BEHIND_M / 2.0)


_Lanes = tuple[int, int]
"""Number of lanes of a stretch of road, and index from the left of the lane along the road's line."""


def _road(
    town: Town, line: Floats, speed_mps: float, changes_m: tuple[float, ...], *, lanes: tuple[_Lanes, ...]
) -> None:
    """Draw a one-way road along the line of a lane, in stretches with `lanes`, which end `changes_m` along the line."""
    town.building_gap_m = (14.0, 35.0)
    s = arc_lengths(line)
    ends = [0, *(int(np.searchsorted(s, at)) for at in changes_m), len(line) - 1]
    for (first, last), (count, own) in zip(pairwise(ends), lanes, strict=True):
        part = line[first : last + 1]
        if len(part) > 2:
            section = Section(count, 0, LANE_M, speed_mps, sidewalk=False)
            trace_road(town, "road", shifted(part, -(own + 0.5) * LANE_M), section)


def _with_lane_between(side: float) -> tuple[_Lanes, ...]:
    """Return the lanes of three stretches, the middle stretch with one more lane on `side` of the line's lane."""
    own = 1 if side > 0.0 else 0
    return (2, own), (3, 1), (2, own)


def _still_to_go(s: Floats, from_m: float, over_m: float) -> Floats:
    """Return 1 before a change of lanes, 0 after it."""
    return np.asarray(0.5 + 0.5 * arrays.cos(np.pi * np.clip((s - from_m) / over_m, 0.0, 1.0)))


def _over_m(speed_mps: float) -> float:
    return min(change_length_m(speed_mps), _MOST_CHANGE_M)


def _ramp_speed(ramp: Floats) -> float:
    """Return the speed at which the ramp's sharpest bend takes 3 m/s2 sideways, limited to 7..14 m/s."""
    turns = np.pad(np.diff(ramp[:, 2]), (4, 3))
    bend = np.abs(moving_sum(turns, (0.125,) * 8)).max()
    return float(np.clip(math.sqrt(_SIDEWAYS_MPS2 / max(bend, 1e-3)), _LEAST_MPS, _RAMP_MPS))


def _point(spec: ScenarioSpec, name: str) -> tuple[float, float]:
    given = spec.parameters[name]
    return given["x"], given["y"]
