"""From a drawn town to lanes: sampled every metre, with neighbours, successors and stop lines."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from pytest_drive_robust.arithmetic import arrays
from pytest_drive_robust.domain.truth import Lane, LaneKind, StopLine
from pytest_drive_robust.simulators.embedded.geometry import arc_lengths, place
from pytest_drive_robust.simulators.embedded.towns.drawn_lanes import CircularLane, StraightLane
from pytest_drive_robust.simulators.embedded.towns.town import JunctionControl, LaneKey, Town
from pytest_drive_robust.simulators.embedded.towns.traced_lane import TracedLane

__all__ = ["draw_lanes", "stop_lines"]

Floats = NDArray[np.float64]
_LINES = {0: "none", 1: "striped", 2: "solid", 3: "solid"}
_JOIN_M = 0.5
"""Two lanes follow each other when end and start are nearer than this."""
_STOP_BEFORE_END_M = 5.0
"""So far before the junction box traffic stops: the crosswalk stays free."""

_Side = tuple[int, bool]
_NOBODY: _Side = (-1, False)


def draw_lanes(town: Town) -> tuple[Lane, ...]:
    """Return every lane of the town, numbered in the order in which they were drawn."""
    keys = list(town.kinds)
    index = {key: k for k, key in enumerate(keys)}
    centres = [_sample(town, key) for key in keys]
    left, right = _neighbours(town, index, centres)
    successors = _successors(town, keys, centres)
    return tuple(
        _lane(town, key, k, centres[k], left=left.get(k, _NOBODY), right=right.get(k, _NOBODY), after=successors[k])
        for k, key in enumerate(keys)
    )


def _lane(
    town: Town, key: LaneKey, index: int, centre: Floats, *, left: _Side, right: _Side, after: tuple[int, ...]
) -> Lane:
    lane = town.network.get_lane(key)
    return Lane(
        index=index,
        kind=town.kinds[key],
        centre=centre,
        width_m=float(lane.width_at(0.0)),
        speed_limit_mps=float(lane.speed_limit),
        junction=key in town.junctions,
        left=left[0],
        right=right[0],
        left_same_way=left[1],
        right_same_way=right[1],
        left_line=_LINES[int(lane.line_types[0])],
        right_line=_LINES[int(lane.line_types[1])],
        successors=after,
    )


def _sample(town: Town, key: LaneKey) -> Floats:
    """Return what `lane.position` and `lane.heading_at` give for a row of distances, at once."""
    lane = town.network.get_lane(key)
    if isinstance(lane, TracedLane):
        return lane.centre
    count = max(2, round(lane.length) + 1)
    at = np.linspace(0.0, lane.length, count)
    if isinstance(lane, CircularLane | StraightLane):
        return lane.sampled(at)
    raise TypeError(f"town {town.name}: lane {key} is a {type(lane).__name__}, expected straight, circular or traced")


def _neighbours(
    town: Town, index: dict[LaneKey, int], centres: list[Floats]
) -> tuple[dict[int, _Side], dict[int, _Side]]:
    """Return for each lane number what lies to its left and to its right: (lane number, leads the same way)."""
    left: dict[int, _Side] = {}
    right: dict[int, _Side] = {}
    for strip in town.slices:
        lanes = [(index[key], along) for key, along in strip]
        for (west, west_along), (east, east_along) in pairwise(lanes):
            same_way = west_along == east_along
            (right if west_along else left)[west] = (east, same_way)
            (left if east_along else right)[east] = (west, same_way)
    return left, right


def _successors(town: Town, keys: list[LaneKey], centres: list[Floats]) -> list[tuple[int, ...]]:
    """Return the lanes of the same kind that begin where each lane ends, heading the same way."""
    kinds = np.array([int(town.kinds[key]) for key in keys])
    starts, ends = np.array([centre[0] for centre in centres]), np.array([centre[-1] for centre in centres])
    meets = arrays.hypot(*(ends[:, None, :2] - starts[None, :, :2]).transpose(2, 0, 1)) < _JOIN_M
    meets &= arrays.cos(ends[:, None, 2] - starts[None, :, 2]) > 0.9
    meets &= kinds[:, None] == kinds[None, :]
    np.fill_diagonal(meets, False)
    return [tuple(int(other) for other in np.flatnonzero(row)) for row in meets]


def stop_lines(town: Town, lanes: tuple[Lane, ...]) -> tuple[StopLine, ...]:
    """Return a stop line for each controlled lane, `_STOP_BEFORE_END_M` before its end.

    A light stands at the far corner of the junction, where a driver at the line can see it; a sign stands at the line.
    Both stand to the right of the outermost lane.
    """
    index = {key: k for k, key in enumerate(town.kinds)}
    return tuple(_stop_line(k, lanes[index[control.lane]], control, lanes) for k, control in enumerate(town.controls))


def _stop_line(k: int, lane: Lane, control: JunctionControl, lanes: tuple[Lane, ...]) -> StopLine:
    length = arc_lengths(lane.centre)[-1]
    x, y, heading = place(lane.centre, length - _STOP_BEFORE_END_M)
    edge = lane.width_m / 2.0 + _to_kerb_m(lanes, lane)
    is_light = control.what == "light"
    pole = place(lane.centre, length + control.far_m, edge + control.aside_m) if is_light else place(
        lane.centre, length - _STOP_BEFORE_END_M + 0.5, edge + 1.0
    )  # fmt: skip
    return StopLine(k, lane.index, x, y, heading, lane.width_m, is_light, pole[0], pole[1])


def _to_kerb_m(lanes: tuple[Lane, ...], lane: Lane) -> float:
    """Return the width of the lanes that lie to the right of this one, up to the sidewalk."""
    total = 0.0
    while lane.right >= 0 and lane.right_same_way and lanes[lane.right].kind is not LaneKind.SIDEWALK:
        lane = lanes[lane.right]
        total += lane.width_m
    return total
