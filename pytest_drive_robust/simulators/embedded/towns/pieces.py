"""Roads made of straight and circular pieces."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np

from pytest_drive_robust.arithmetic import arrays, scalars
from pytest_drive_robust.arithmetic.random_numbers import RandomNumbers, Range
from pytest_drive_robust.domain.truth import LaneKind
from pytest_drive_robust.jit.arrays import Floats
from pytest_drive_robust.simulators.embedded.geometry import Pose, moved
from pytest_drive_robust.simulators.embedded.towns.town import DrawnLane, Section, Town

Piece = tuple[float, float]
"""(length in metres, curvature in 1/m, positive to the right)."""

PLAIN = ("none", "none")
"""Lane lines (left, right) of a lane without lines."""

_SIDEWALK_WIDTH_M = 3.0
_PARKING_WIDTH_M = 2.4


def advance(pose: Pose, length: float, curvature: float) -> Pose:
    """Return the pose after `length` metres on a line or an arc (curvature positive to the right)."""
    x, y, heading = pose
    if curvature == 0.0:
        return moved(pose, length)
    turned = heading + length * curvature
    return (
        x + (scalars.sin(turned) - scalars.sin(heading)) / curvature,
        y - (scalars.cos(turned) - scalars.cos(heading)) / curvature,
        turned,
    )


def retreat(pose: Pose, pieces: list[Piece]) -> Pose:
    """Return where a road of these pieces must start to end at `pose`."""
    x, y, heading = pose
    for length, curvature in reversed(pieces):
        x, y, heading = advance((x, y, heading + math.pi), length, -curvature)
        heading -= math.pi
    return x, y, heading


def piece(
    pose: Pose, length: float, curvature: float, offset: float = 0.0, *, backward: bool = False, **lane: Any
) -> DrawnLane:
    """Return a lane `offset` metres to the right of a reference piece, along it or against it."""
    x, y, heading = pose
    right = np.array([-scalars.sin(heading), scalars.cos(heading)])
    if curvature == 0.0:
        start = np.array([x, y]) + offset * right
        end = start + length * np.array([scalars.cos(heading), scalars.sin(heading)])
        return _straight(end, start, **lane) if backward else _straight(start, end, **lane)
    radius = 1.0 / curvature  # signed: positive turns right
    centre = np.array([x, y]) + radius * right
    phase = heading - math.copysign(math.pi / 2.0, curvature)
    turned = phase + length * curvature
    own = abs(radius) - offset * math.copysign(1.0, curvature)
    way = int(math.copysign(1.0, curvature))
    return _arc(centre, own, turned, phase, -way, **lane) if backward else _arc(centre, own, phase, turned, way, **lane)


def _straight(start: Floats, end: Floats, **lane: Any) -> DrawnLane:
    dx, dy = float(end[0] - start[0]), float(end[1] - start[1])
    length = scalars.hypot(dx, dy)
    at = np.linspace(0.0, length, max(2, round(length) + 1))
    points = start + at[:, None] * (np.array([dx, dy]) / length)
    return DrawnLane(np.column_stack([points, np.full(len(at), scalars.atan2(dy, dx))]), length, **lane)


def _arc(centre: Floats, radius: float, start_rad: float, end_rad: float, way: int, **lane: Any) -> DrawnLane:
    """Return an arc between two directions from its centre; `way` is 1 for one to the right, -1 to the left."""
    length = radius * (end_rad - start_rad) * way
    at = np.linspace(0.0, length, max(2, round(length) + 1))
    phase = way * at / radius + start_rad
    x, y = centre[0] + radius * arrays.cos(phase), centre[1] + radius * arrays.sin(phase)
    return DrawnLane(np.column_stack([x, y, phase + np.pi / 2.0 * way]), length, **lane)


def road(town: Town, name: str, start: Pose, pieces: list[Piece], section: Section) -> Pose:
    """Draw a road, add each of its lanes to `town.chains` from end to end, and return the pose of its end.

    The reference line is the divider between the two ways, or the left edge of a one-way road. Chains are `<name>.f0`
    (forward, nearest to the divider), `<name>.f1`, ..., `<name>.b0`, ..., and to the right of each way `<name>.fbike`,
    `<name>.fpark`, `<name>.fwalk`, `<name>.bbike`, ... Several calls make one road whose section changes.
    """
    pose = start
    for drawn in pieces:
        draw_strips(town, name, partial(piece, pose, *drawn), section)
        pose = advance(pose, *drawn)
    return pose


def draw_strips(town: Town, name: str, curve: Callable[..., DrawnLane], section: Section) -> None:
    """Draw the lanes of one piece of road side by side and add them as a slice; `curve` draws a lane at an offset."""
    placed: list[tuple[float, int, bool]] = []
    for suffix, offset, width, kind, lines in _strips(section):
        backward = suffix.startswith("b")
        signed = -offset if backward else offset
        drawn = curve(signed, backward=backward, width_m=width, lines=lines, speed_mps=section.speed_mps, kind=kind)
        number = town.add(drawn)
        chain = town.chains.setdefault(f"{name}.{suffix}", [])
        chain.insert(0, number) if backward else chain.append(number)
        placed.append((signed, number, not backward))
    town.slices.append(tuple((number, along) for _, number, along in sorted(placed)))


def _strips(section: Section) -> Iterator[tuple[str, float, float, LaneKind, tuple[str, str]]]:
    """Yield for each lane of a road the suffix of its chain's name, offset, width, kind and lines."""
    yield from _way(section, "f", section.forward)
    yield from _way(section, "b", section.backward)
    if section.left_walk:
        # drawn against the traffic, so that houses stand on its right side, as on all sidewalks
        edge = _PARKING_WIDTH_M if section.left_parking else 0.0
        yield "bwalk", edge + _SIDEWALK_WIDTH_M / 2.0, _SIDEWALK_WIDTH_M, LaneKind.SIDEWALK, PLAIN
    if section.left_parking:
        yield "fleft", -_PARKING_WIDTH_M / 2.0, _PARKING_WIDTH_M, LaneKind.PARKING, ("solid", "none")


def _way(section: Section, way: str, count: int) -> Iterator[tuple[str, float, float, LaneKind, tuple[str, str]]]:
    edge = count * section.width_m
    inner = "striped" if section.forward and section.backward and count == 1 else "solid"
    for lane in range(count):
        lines = inner if lane == 0 else "striped", "striped" if lane < count - 1 else "solid"
        yield f"{way}{lane}", (lane + 0.5) * section.width_m, section.width_m, LaneKind.DRIVING, lines
    for suffix, width, kind, right in (
        ("bike", section.biking_m, LaneKind.BIKING, "solid"),
        ("park", _PARKING_WIDTH_M if section.parking else 0.0, LaneKind.PARKING, "solid"),
        ("walk", _SIDEWALK_WIDTH_M if section.sidewalk else 0.0, LaneKind.SIDEWALK, "none"),
    ):
        if count and width:
            yield f"{way}{suffix}", edge + width / 2.0, width, kind, ("none", right)
            edge += width


def winding(rng: RandomNumbers, total_m: float, *, radius_m: Range, arc_m: Range = (25.0, 45.0)) -> list[Piece]:
    """Return the pieces of a gently winding road of `total_m` metres: line, arc, line, counter-arc, line."""
    sign = 1.0 if rng.random() < 0.5 else -1.0
    arc = rng.uniform(*arc_m)
    straight = (total_m - 2.0 * arc) / 3.0
    radius = rng.uniform(*radius_m)
    return [(straight, 0.0), (arc, sign / radius), (straight, 0.0), (arc, -sign / radius), (straight, 0.0)]
