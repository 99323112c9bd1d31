"""Roads made of straight and circular pieces."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial

import numpy as np

from pytest_drive_robust.arithmetic import scalars
from pytest_drive_robust.arithmetic.random_numbers import RandomNumbers
from pytest_drive_robust.domain.truth import LaneKind
from pytest_drive_robust.simulators.embedded.towns.drawn_lanes import CircularLane, StraightLane
from pytest_drive_robust.simulators.embedded.towns.road_library import AbstractLane, LineType
from pytest_drive_robust.simulators.embedded.towns.town import LaneKey, Pose, Section, Town

__all__ = ["Piece", "advance", "beside", "draw_strips", "piece", "retreat", "road", "winding"]

Piece = tuple[float, float]
"""(length in metres, curvature in 1/m, positive to the right)."""

_STRIPED, _SOLID, _NONE = LineType.STRIPED, LineType.CONTINUOUS_LINE, LineType.NONE
_SIDEWALK_WIDTH_M = 3.0
_PARKING_WIDTH_M = 2.4


def advance(pose: Pose, length: float, curvature: float) -> Pose:
    """Return the pose after `length` metres on a line or an arc (curvature positive to the right)."""
    x, y, heading = pose
    if curvature == 0.0:
        return x + length * scalars.cos(heading), y + length * scalars.sin(heading), heading
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


def beside(pose: Pose, right_m: float) -> Pose:
    """Return the pose `right_m` metres to the right, same heading."""
    x, y, heading = pose
    return x - right_m * scalars.sin(heading), y + right_m * scalars.cos(heading), heading


def piece(
    pose: Pose, length: float, curvature: float, offset: float, *, backward: bool, **lane: object
) -> AbstractLane:
    """Return a highway-env lane `offset` metres to the right of a reference piece, along it or against it."""
    x, y, heading = pose
    right = np.array([-scalars.sin(heading), scalars.cos(heading)])
    if curvature == 0.0:
        start = np.array([x, y]) + offset * right
        end = start + length * np.array([scalars.cos(heading), scalars.sin(heading)])
        return StraightLane(end, start, **lane) if backward else StraightLane(start, end, **lane)
    radius = 1.0 / curvature  # signed: positive turns right
    centre = np.array([x, y]) + radius * right
    phase = heading - math.copysign(math.pi / 2.0, curvature)
    turned = phase + length * curvature
    own = abs(radius) - offset * math.copysign(1.0, curvature)
    clockwise = curvature > 0.0
    if backward:
        return CircularLane(centre, own, turned, phase, clockwise=not clockwise, **lane)
    return CircularLane(centre, own, phase, turned, clockwise=clockwise, **lane)


def road(town: Town, name: str, start: Pose, pieces: list[Piece], section: Section, *, first: int = 0) -> Pose:
    """Draw a road and fill `town.chains` with every lane's keys from end to end. Return where it ends.

    The reference line is the divider between the two ways, or the left edge of a one-way road. Chains are `<name>.f0`
    (forward, nearest to the divider), `<name>.f1`, ..., `<name>.b0`, ..., and to the right of each way `<name>.fbike`,
    `<name>.fpark`, `<name>.fwalk`, `<name>.bbike`, ... Several calls with growing `first` (the number of the first
    piece) make one road whose section changes.
    """
    pose = start
    for number, drawn in enumerate(pieces, start=first):
        draw_strips(town, name, number, partial(piece, pose, *drawn), section)
        pose = advance(pose, *drawn)
    return pose


def draw_strips(town: Town, name: str, number: int, curve: Callable[..., AbstractLane], section: Section) -> None:
    """Draw piece `number` of a road, whose lanes `curve` makes as `piece` does once it knows its reference piece."""
    _Strips(town, name, (f"{name}{number}", f"{name}{number + 1}"), curve, section).draw()


class _Strips:
    """Draws the lanes of one piece of road side by side and notes them as a slice of the town."""

    def __init__(
        self, town: Town, name: str, nodes: tuple[str, str], curve: Callable[..., AbstractLane], section: Section
    ) -> None:
        self._town, self._name, self._nodes = town, name, nodes
        self._curve, self._section = curve, section
        self._placed: list[tuple[float, LaneKey, bool]] = []

    def draw(self) -> None:
        section = self._section
        self._way("f", section.forward)
        self._way("b", section.backward)
        if section.left_walk:
            # drawn against the traffic, so that its right side is where houses stand, as everywhere
            edge = _PARKING_WIDTH_M if section.left_parking else 0.0
            self._lane("bwalk", edge + _SIDEWALK_WIDTH_M / 2.0, _SIDEWALK_WIDTH_M, LaneKind.SIDEWALK, (_NONE, _NONE))
        if section.left_parking:
            self._lane("fleft", -_PARKING_WIDTH_M / 2.0, _PARKING_WIDTH_M, LaneKind.PARKING, (_SOLID, _NONE))
        self._town.slices.append(tuple((key, along) for _, key, along in sorted(self._placed)))

    def _way(self, way: str, count: int) -> None:
        section, edge = self._section, count * self._section.width_m
        inner = _SOLID if section.backward and count > 1 else _STRIPED
        if not (section.forward and section.backward):
            inner = _SOLID
        for lane in range(count):
            lines = (inner if lane == 0 else _STRIPED, _STRIPED if lane < count - 1 else _SOLID)
            self._lane(f"{way}{lane}", (lane + 0.5) * section.width_m, section.width_m, LaneKind.DRIVING, lines)
        if not count:
            return
        for suffix, width, kind, right in (
            ("bike", section.biking_m, LaneKind.BIKING, _SOLID),
            ("park", _PARKING_WIDTH_M if section.parking else 0.0, LaneKind.PARKING, _SOLID),
            ("walk", _SIDEWALK_WIDTH_M if section.sidewalk else 0.0, LaneKind.SIDEWALK, _NONE),
        ):
            if width:
                self._lane(f"{way}{suffix}", edge + width / 2.0, width, kind, (_NONE, right))
                edge += width

    def _lane(self, suffix: str, offset: float, width: float, kind: LaneKind, lines: tuple[int, int]) -> None:
        backward = suffix.startswith("b")
        signed = -offset if backward else offset
        start, end = (f"{self._nodes[1]}r", f"{self._nodes[0]}r") if backward else self._nodes
        lane = self._curve(
            signed, backward=backward, width=width, line_types=lines, speed_limit=self._section.speed_mps
        )
        marks = "" if kind is LaneKind.DRIVING else f"{suffix[0]}{kind.name.lower()}{'left' * (suffix == 'fleft')}"
        key = self._town.add(start + marks, end + marks, lane, kind=kind)
        chain = self._town.chains.setdefault(f"{self._name}.{suffix}", [])
        chain.insert(0, key) if backward else chain.append(key)
        self._placed.append((signed, key, not backward))


def winding(rng: RandomNumbers, total_m: float, *, radius_m: Piece, arc_m: Piece = (25.0, 45.0)) -> list[Piece]:
    """Return the pieces of a gently winding road of `total_m` metres: line, arc, line, counter-arc, line."""
    sign = 1.0 if rng.random() < 0.5 else -1.0
    arc = rng.uniform(*arc_m)
    straight = (total_m - 2.0 * arc) / 3.0
    radius = rng.uniform(*radius_m)
    return [(straight, 0.0), (arc, sign / radius), (straight, 0.0), (arc, -sign / radius), (straight, 0.0)]
