"""The towns: small maps written with highway-env's road network and lane classes.

A town is named `<Style><number>`; the number seeds its proportions, so `Street7` is the same town in every process.
Each style is one function that draws roads with `_road`. highway-env knows no lane kinds, junctions, stop lines or
buildings: `Town` notes them beside the network.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from highway_env.road.lane import AbstractLane, CircularLane, LineType, StraightLane
from highway_env.road.road import RoadNetwork
from numpy.typing import NDArray

from pytest_drive_robust.domain.truth import LaneKind
from pytest_drive_robust.errors import RouteError, UnknownNameError

__all__ = ["STYLES", "Arm", "Town", "build_town"]

LaneKey = tuple[str, str, int]
Pose = tuple[float, float, float]
_STRIPED, _SOLID, _NONE = LineType.STRIPED, LineType.CONTINUOUS_LINE, LineType.NONE
_SIDEWALK_WIDTH_M = 3.0
_PARKING_WIDTH_M = 2.4


@dataclass(frozen=True, slots=True)
class Arm:
    """A junction arm: unit heading away from the centre and the distance of its stop line from the centre."""

    name: str
    heading_rad: float
    box_m: float


@dataclass(slots=True)
class Town:
    """What a style draws: highway-env's network plus what highway-env cannot say.

    `kinds`, `junctions` are keyed like highway-env's lanes: (from node, to node, number). `controls` lists
    (lane, `"light"` or `"stop"`): what stands at the end of that lane. `crosswalks` are 4 x 2 corners in metres.
    """

    name: str
    network: RoadNetwork = field(default_factory=RoadNetwork)
    kinds: dict[LaneKey, LaneKind] = field(default_factory=dict)
    junctions: set[LaneKey] = field(default_factory=set)
    controls: list[tuple[LaneKey, str]] = field(default_factory=list)
    crosswalks: list[NDArray[np.float64]] = field(default_factory=list)
    chains: dict[str, list[LaneKey]] = field(default_factory=dict)
    building_gap_m: float = 9.0

    def add(self, start: str, end: str, lane: AbstractLane, *, kind: LaneKind = LaneKind.DRIVING) -> LaneKey:
        """Add a lane between two nodes and note its kind."""
        self.network.add_lane(start, end, lane)
        key = (start, end, len(self.network.graph[start][end]) - 1)
        self.kinds[key] = kind
        return key


@dataclass(frozen=True, slots=True)
class _Section:
    """The cross-section of a road, seen in its direction: lanes per way, width, speed limit, what lies beside."""

    forward: int
    backward: int
    width_m: float
    speed_mps: float
    parking: bool = False
    sidewalk: bool = True


def _advance(pose: Pose, length: float, curvature: float) -> Pose:
    """The pose after `length` metres on a line or an arc (curvature positive to the right)."""
    x, y, heading = pose
    if curvature == 0.0:
        return x + length * math.cos(heading), y + length * math.sin(heading), heading
    turned = heading + length * curvature
    return (
        x + (math.sin(turned) - math.sin(heading)) / curvature,
        y - (math.cos(turned) - math.cos(heading)) / curvature,
        turned,
    )


def _piece(
    pose: Pose, length: float, curvature: float, offset: float, *, backward: bool, **lane: object
) -> AbstractLane:
    """A highway-env lane `offset` metres to the right of a reference piece, along it or against it."""
    x, y, heading = pose
    right = np.array([-math.sin(heading), math.cos(heading)])
    if curvature == 0.0:
        start = np.array([x, y]) + offset * right
        end = start + length * np.array([math.cos(heading), math.sin(heading)])
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


def _road(town: Town, name: str, start: Pose, pieces: list[tuple[float, float]], section: _Section) -> Pose:
    """Draw a road of (length, curvature) pieces; fills `town.chains` with every lane's keys from end to end.

    The reference line is the divider between the two ways. Chains are `<name>.f0` (forward, nearest to the divider),
    `<name>.f1`, ..., `<name>.b0`, ..., and to the right of each way `<name>.fpark`, `<name>.fwalk`, `<name>.bpark`, ...
    """
    pose = start
    for number, (length, curvature) in enumerate(pieces):
        here, there = f"{name}{number}", f"{name}{number + 1}"
        for way, count in (("f", section.forward), ("b", section.backward)):
            _carriageway(town, name, (here, there), pose, (length, curvature), section, way=way, count=count)
        pose = _advance(pose, length, curvature)
    return pose


def _carriageway(
    town: Town,
    name: str,
    nodes: tuple[str, str],
    pose: Pose,
    piece: tuple[float, float],
    section: _Section,
    *,
    way: str,
    count: int,
) -> None:
    backward = way == "b"
    side = -1.0 if backward else 1.0
    ends = (f"{nodes[1]}r", f"{nodes[0]}r") if backward else nodes
    inner = _SOLID if section.backward and count > 1 else _STRIPED
    if not (section.forward and section.backward):
        inner = _SOLID
    edge = count * section.width_m

    def draw(suffix: str, offset: float, width: float, kind: LaneKind, lines: tuple[int, int]) -> None:
        lane = _piece(
            pose, *piece, side * offset, backward=backward, width=width, line_types=lines, speed_limit=section.speed_mps
        )
        marks = "" if kind is LaneKind.DRIVING else f"{kind.name.lower()}"
        key = town.add(ends[0] + marks, ends[1] + marks, lane, kind=kind)
        chain = town.chains.setdefault(f"{name}.{suffix}", [])
        chain.insert(0, key) if backward else chain.append(key)

    for lane in range(count):
        left = inner if lane == 0 else _STRIPED
        right = _STRIPED if lane < count - 1 else _SOLID
        draw(f"{way}{lane}", (lane + 0.5) * section.width_m, section.width_m, LaneKind.DRIVING, (left, right))
    if section.parking and count:
        draw(f"{way}park", edge + _PARKING_WIDTH_M / 2.0, _PARKING_WIDTH_M, LaneKind.PARKING, (_NONE, _SOLID))
        edge += _PARKING_WIDTH_M
    if section.sidewalk and count:
        draw(f"{way}walk", edge + _SIDEWALK_WIDTH_M / 2.0, _SIDEWALK_WIDTH_M, LaneKind.SIDEWALK, (_NONE, _NONE))


def _bend(rng: np.random.Generator, total_m: float, *, radius_m: tuple[float, float]) -> list[tuple[float, float]]:
    """Pieces of a gently winding road of `total_m` metres: line, arc, line, counter-arc, line."""
    sign = 1.0 if rng.random() < 0.5 else -1.0
    arc = float(rng.uniform(25.0, 45.0))
    straight = (total_m - 2.0 * arc) / 3.0
    radius = float(rng.uniform(*radius_m))
    return [(straight, 0.0), (arc, sign / radius), (straight, 0.0), (arc, -sign / radius), (straight, 0.0)]


def _street(town: Town, rng: np.random.Generator) -> None:
    """A two-way street, one lane each way, straight or winding, with sidewalks."""
    section = _Section(1, 1, float(rng.uniform(3.4, 3.8)), float(rng.choice([11.0, 12.5, 13.9])))
    pieces = [(320.0, 0.0)] if rng.random() < 0.4 else _bend(rng, 320.0, radius_m=(90.0, 160.0))
    _road(town, "road", (-100.0, 0.0, 0.0), pieces, section)


def _lane_street(town: Town, rng: np.random.Generator) -> None:
    """A two-way street, one lane each way, with parking lanes and sidewalks."""
    section = _Section(1, 1, float(rng.uniform(3.4, 3.7)), float(rng.choice([11.0, 12.5])), parking=True)
    pieces = [(320.0, 0.0)] if rng.random() < 0.6 else _bend(rng, 320.0, radius_m=(110.0, 180.0))
    _road(town, "road", (-100.0, 0.0, 0.0), pieces, section)


def _avenue(town: Town, rng: np.random.Generator) -> None:
    """A two-way avenue, two lanes each way, with sidewalks."""
    section = _Section(2, 2, float(rng.uniform(3.3, 3.6)), float(rng.choice([12.5, 13.9])))
    pieces = [(340.0, 0.0)] if rng.random() < 0.5 else _bend(rng, 340.0, radius_m=(130.0, 220.0))
    _road(town, "road", (-100.0, 0.0, 0.0), pieces, section)


def _highway(town: Town, rng: np.random.Generator) -> None:
    """One carriageway of a motorway: two lanes and an entry lane to their right."""
    section = _Section(3, 0, 3.6, float(rng.choice([20.0, 22.0])), sidewalk=False)
    pieces = [(520.0, 0.0)] if rng.random() < 0.5 else _bend(rng, 520.0, radius_m=(300.0, 500.0))
    _road(town, "road", (-120.0, 0.0, 0.0), pieces, section)
    town.building_gap_m = 30.0


def _crossing(control: str | None, *, lanes: int) -> Callable[[Town, np.random.Generator], None]:
    def draw(town: Town, rng: np.random.Generator) -> None:
        width = float(rng.uniform(3.4, 3.7))
        section = _Section(lanes, lanes, width, float(rng.choice([10.0, 11.0, 12.5])))
        box = lanes * width + float(rng.uniform(5.0, 8.0))
        arms = [Arm(name, k * math.pi / 2.0, box) for k, name in enumerate("ESWN")]
        for arm in arms:
            start = (box * math.cos(arm.heading_rad), box * math.sin(arm.heading_rad), arm.heading_rad)
            _road(town, arm.name, start, [(110.0, 0.0)], section)
            _crosswalk(town, arm, lanes * width)
        for k, arm in enumerate(arms):
            _turns(town, arm, arms, k, section, control=control)

    draw.__doc__ = f"A crossing of four arms, {lanes} lane(s) each way, {control or 'no'} control."
    return draw


def _crosswalk(town: Town, arm: Arm, half_m: float) -> None:
    ahead = np.array([math.cos(arm.heading_rad), math.sin(arm.heading_rad)])
    right = np.array([-ahead[1], ahead[0]])
    near, far = arm.box_m + 0.6, arm.box_m + 3.6
    corners = [near * ahead - half_m * right, far * ahead - half_m * right]
    town.crosswalks.append(np.array([*corners, far * ahead + half_m * right, near * ahead + half_m * right]))


def _turns(town: Town, arm: Arm, arms: list[Arm], k: int, section: _Section, *, control: str | None) -> None:
    """Connect the lanes that come in on `arm`: the innermost turns left, the outermost right, all go straight."""
    inward = arm.heading_rad + math.pi
    back = np.array([math.cos(arm.heading_rad), math.sin(arm.heading_rad)]) * arm.box_m
    right = np.array([-math.sin(inward), math.cos(inward)])
    style = {"width": section.width_m, "line_types": (_NONE, _NONE), "speed_limit": section.speed_mps}
    for lane in range(section.forward):
        offset = (lane + 0.5) * section.width_m
        entry = back + offset * right
        pose = (float(entry[0]), float(entry[1]), inward)
        source = town.chains[f"{arm.name}.b{lane}"][-1]
        ways: list[tuple[str, int, float, float]] = [("straight", 2, 2.0 * arm.box_m, 0.0)]
        if lane == 0:
            radius = arm.box_m + offset
            ways.append(("left", 1, radius * math.pi / 2.0, -1.0 / radius))
        if lane == section.forward - 1:
            radius = arm.box_m - offset
            ways.append(("right", 3, radius * math.pi / 2.0, 1.0 / radius))
        for name, step, length, curvature in ways:
            target = arms[(k + step) % 4]
            # arms are named clockwise; entering on E and turning left leaves on S, right on N
            key = town.add(
                source[1],
                f"{target.name}0",
                _piece(pose, length, curvature, 0.0, backward=False, **style),
            )
            town.junctions.add(key)
            town.chains[f"{arm.name}.{name}{lane}"] = [
                *town.chains[f"{arm.name}.b{lane}"],
                key,
                *town.chains[f"{target.name}.f{lane}"],
            ]
        if control is not None:
            town.controls.append((source, control))


STYLES: dict[str, Callable[[Town, np.random.Generator], None]] = {
    "Street": _street,
    "ParkingStreet": _lane_street,
    "Avenue": _avenue,
    "Highway": _highway,
    "LightCrossing": _crossing("light", lanes=1),
    "LightAvenueCrossing": _crossing("light", lanes=2),
    "StopCrossing": _crossing("stop", lanes=1),
    "OpenCrossing": _crossing(None, lanes=1),
}
"""Every style of town by name."""


def build_town(name: str) -> Town:
    """Draw the town `<Style><number>`. Raises `RouteError` or `UnknownNameError` for any other name."""
    match = re.fullmatch(r"([A-Za-z]+)(\d{1,6})", name)
    if match is None:
        raise RouteError(
            f"town {name!r} is none of ours: expected a style and a number such as 'Street1'. "
            f"Styles: {', '.join(sorted(STYLES))}."
        )
    style, number = match[1], int(match[2])
    if style not in STYLES:
        raise UnknownNameError.of("town style", style, STYLES)
    town = Town(name)
    STYLES[style](town, np.random.Generator(np.random.Philox(key=[number, 0x70776E])))
    return town
