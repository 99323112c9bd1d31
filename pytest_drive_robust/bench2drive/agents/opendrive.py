"""The map of a world as OpenDRIVE text, which CARLA's own `carla.Map` reads.

Lanes that run side by side are one road, on which lanes can be changed; where lanes part or meet there is a junction.
OpenDRIVE's y points north, ours south; a road leads along the left edge of its leftmost lane.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from xml.sax.saxutils import quoteattr

import numpy as np

from pytest_drive_robust.domain.truth import Lane, LaneKind, LaneMap

_ALIGNED_M = 1.0
"""Lanes that begin and end beside each other, to this accuracy, belong to one road."""


@dataclass(frozen=True, slots=True)
class Road:
    """`lanes` from left to right: the k-th is lane -(k + 1) of the road in OpenDRIVE."""

    id: int
    lanes: tuple[Lane, ...]

    @property
    def junction(self) -> bool:
        """True when the road lies in a junction."""
        return any(lane.junction for lane in self.lanes)


def roads_of(lanes: Sequence[Lane]) -> tuple[Road, ...]:
    """Return roads that hold each lane exactly once; the number of a road is that of its leftmost lane."""
    by_index = {lane.index: lane for lane in lanes}
    found: list[Road] = []
    for lane in lanes:
        if _left_of(lane, by_index) is not None:
            continue
        beside = [lane]
        while (right := by_index.get(beside[-1].right)) is not None and _left_of(right, by_index) is beside[-1]:
            beside.append(right)
        found.append(Road(lane.index, tuple(beside)))
    return tuple(found)


def _left_of(lane: Lane, by_index: dict[int, Lane]) -> Lane | None:
    """Return the lane to the left of `lane` if both belong to one road, else None."""
    left = by_index.get(lane.left)
    if left is None or not lane.left_same_way or left.right != lane.index or lane.junction or left.junction:
        return None
    apart_m = (left.width_m + lane.width_m) / 2.0
    for row in (0, -1):
        x, y, yaw = np.asarray(left.centre[row], dtype=float)
        beside = np.array([x - np.sin(yaw) * apart_m, y + np.cos(yaw) * apart_m])
        if np.hypot(*(np.asarray(lane.centre[row, :2]) - beside)) > _ALIGNED_M:
            return None
    return left


_TYPES: Mapping[LaneKind, str] = {
    LaneKind.DRIVING: "driving",
    LaneKind.PARKING: "parking",
    LaneKind.SIDEWALK: "sidewalk",
    LaneKind.BIKING: "biking",
}
_MARKS: Mapping[str, str] = {"none": "none", "striped": "broken", "solid": "solid"}
_FIRST_END = 50_000
_END_ROWS = 3
_FIRST_JUNCTION = 100_000
_SHORTEST_M = 1e-6

_Links = list[tuple[int, int, int, int]]
"""(road, lane, next road, lane of the next road), in the numbers of OpenDRIVE."""


def opendrive_of(lane_map: LaneMap) -> str:
    """Return the map in OpenDRIVE 1.4; a road has the number of its leftmost lane.

    The end of a lane without a successor becomes one more road, because CARLA's planner knows only roads that lead on.
    """
    roads = roads_of(_with_ends(lane_map.lanes))
    links = _links(roads)
    junctions = _junctions(roads, links)
    inside = {road: number for number, group in junctions.items() for road in group}
    parts = [
        '<?xml version="1.0" standalone="yes"?>',
        "<OpenDRIVE>",
        f'<header revMajor="1" revMinor="4" name={quoteattr(lane_map.name)} version="1.00" north="0" south="0" '
        'east="0" west="0"><geoReference><![CDATA[+proj=tmerc +lat_0=0 +lon_0=0]]></geoReference></header>',
    ]
    for road in roads:
        parts += _road(road, inside, links)
    for number, group in junctions.items():
        parts += _junction(number, group, links)
    return "\n".join([*parts, "</OpenDRIVE>"])


def _with_ends(lanes: Sequence[Lane]) -> list[Lane]:
    """Cut off the last stretch of each lane without a successor; return all lanes.

    The stretch becomes a lane of its own, whose number is `_FIRST_END` higher."""
    cut = {lane.index for lane in lanes if not lane.successors and len(lane.centre) > 2 * _END_ROWS}
    found: list[Lane] = []
    for lane in lanes:
        if lane.index not in cut:
            found.append(lane)
            continue
        end = _FIRST_END + lane.index
        left, right = (_FIRST_END + side if side in cut else -1 for side in (lane.left, lane.right))
        found.append(replace(lane, centre=lane.centre[:-_END_ROWS], successors=(end,)))
        tail = lane.centre[-_END_ROWS - 1 :]
        found.append(replace(lane, index=end, centre=tail, junction=False, left=left, right=right))
    return found


def _links(roads: Sequence[Road]) -> _Links:
    place = {lane.index: (road.id, -1 - k) for road in roads for k, lane in enumerate(road.lanes)}
    return [(*place[lane.index], *place[after]) for road in roads for lane in road.lanes for after in lane.successors]


def _junctions(roads: Sequence[Road], links: _Links) -> dict[int, list[int]]:
    """Return the roads inside each junction: flagged roads, and all successors of a road with several successors."""
    home: dict[int, int] = {}

    def find(road: int) -> int:
        while home.setdefault(road, road) != road:
            road = home[road]
        return road

    for road in roads:
        after = sorted({link[2] for link in links if link[0] == road.id})
        if road.junction:
            find(road.id)
        for other in after[1:]:
            home[find(other)] = find(after[0])
    groups: dict[int, list[int]] = {}
    for number in sorted(home):
        groups.setdefault(find(number), []).append(number)
    return {_FIRST_JUNCTION + number: groups[road] for number, road in enumerate(sorted(groups))}


def _road(road: Road, inside: Mapping[int, int], links: _Links) -> Iterator[str]:
    first = road.lanes[0]
    geometry, length_m = _geometry(first)
    if not geometry:
        return
    after = {link[2] for link in links if link[0] == road.id}
    before = {link[0] for link in links if link[2] == road.id}
    yield f'<road name="road {road.id}" length="{length_m:.6f}" id="{road.id}" junction="{inside.get(road.id, -1)}">'
    yield "<link>"
    if before:
        yield f'<predecessor elementType="road" elementId="{min(before)}" contactPoint="end"/>'
    if after and min(after) in inside:
        yield f'<successor elementType="junction" elementId="{inside[min(after)]}"/>'
    elif after:
        yield f'<successor elementType="road" elementId="{min(after)}" contactPoint="start"/>'
    yield "</link>"
    yield f'<type s="0.0" type="town"><speed max="{first.speed_limit_mps * 3.6:.3f}" unit="km/h"/></type>'
    yield f"<planView>{''.join(geometry)}</planView>"
    yield '<elevationProfile><elevation s="0" a="0" b="0" c="0" d="0"/></elevationProfile>'
    yield f'<lanes><laneSection s="0.0"><center><lane id="0" type="none" level="false">{_mark(first.left_line)}</lane>'
    yield "</center><right>"
    for k, lane in enumerate(road.lanes):
        yield from _lane(lane, -1 - k, road.id, links)
    yield "</right></laneSection></lanes></road>"


def _lane(lane: Lane, number: int, road: int, links: _Links) -> Iterator[str]:
    yield f'<lane id="{number}" type="{_TYPES[lane.kind]}" level="false"><link>'
    before = [link[1] for link in links if link[2:] == (road, number)]
    after = [link[3] for link in links if link[:2] == (road, number)]
    yield f'<predecessor id="{before[0]}"/>' if before else ""
    yield f'<successor id="{after[0]}"/>' if after else ""
    yield f'</link><width sOffset="0" a="{lane.width_m:.4f}" b="0" c="0" d="0"/>{_mark(lane.right_line)}</lane>'


def _geometry(lane: Lane) -> tuple[list[str], float]:
    """Return straight pieces along the left edge of the lane, and their length in metres."""
    x, y, yaw = np.asarray(lane.centre, dtype=float).T
    left_x, left_y = x + np.sin(yaw) * lane.width_m / 2.0, y - np.cos(yaw) * lane.width_m / 2.0
    pieces, s = [], 0.0
    for k in range(len(x) - 1):
        dx, dy = float(left_x[k + 1] - left_x[k]), float(left_y[k + 1] - left_y[k])
        length = float(np.hypot(dx, dy))
        if length > _SHORTEST_M:
            pieces.append(
                f'<geometry s="{s:.6f}" x="{left_x[k]:.6f}" y="{-left_y[k]:.6f}" hdg="{np.arctan2(-dy, dx):.9f}" '
                f'length="{length:.6f}"><line/></geometry>'
            )
            s += length
    return pieces, s


def _mark(line: str) -> str:
    kind, change = _MARKS.get(line, "none"), "none" if line == "solid" else "both"
    return (
        f'<roadMark sOffset="0" type="{kind}" weight="standard" color="standard" width="0.12" laneChange="{change}"/>'
    )


def _junction(number: int, group: Sequence[int], links: _Links) -> Iterator[str]:
    yield f'<junction id="{number}" name="junction {number}">'
    ways = sorted({(link[0], link[2]) for link in links if link[2] in group})
    for way, (comes, goes) in enumerate(ways):
        yield f'<connection id="{way}" incomingRoad="{comes}" connectingRoad="{goes}" contactPoint="start">'
        for link in links:
            if (link[0], link[2]) == (comes, goes):
                yield f'<laneLink from="{link[1]}" to="{link[3]}"/>'
        yield "</connection>"
    yield "</junction>"
