"""The map of a world as OpenDRIVE text, which CARLA's own `carla.Map` reads.

Every lane is a road of its own with one lane: where lanes part or meet there is a junction. So a planner finds every
way that lanes lead, but no lane changes. OpenDRIVE's y points north, ours south; its roads lead along the left edge.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from xml.sax.saxutils import quoteattr

import numpy as np

from pytest_drive_robust.domain.truth import Lane, LaneKind, LaneMap

__all__ = ["opendrive_of"]

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


def opendrive_of(lane_map: LaneMap) -> str:
    """The map in OpenDRIVE 1.4; road k is lane k.

    The end of a lane that leads nowhere is one more road, because CARLA's planner knows only roads that lead on.
    """
    lanes = _with_ends(lane_map.lanes)
    junctions = _junctions(lanes)
    before = {after: lane.index for lane in lanes for after in lane.successors}
    inside = {road: number for number, group in junctions.items() for road in group}
    parts = [
        '<?xml version="1.0" standalone="yes"?>',
        "<OpenDRIVE>",
        f'<header revMajor="1" revMinor="4" name={quoteattr(lane_map.name)} version="1.00" north="0" south="0" '
        'east="0" west="0"><geoReference><![CDATA[+proj=tmerc +lat_0=0 +lon_0=0]]></geoReference></header>',
    ]
    for lane in lanes:
        parts += _road(lane, inside, before.get(lane.index))
    for number, group in junctions.items():
        parts += _junction(number, group, lanes)
    return "\n".join([*parts, "</OpenDRIVE>"])


def _with_ends(lanes: Sequence[Lane]) -> list[Lane]:
    """The same with the last stretch of each lane without a successor cut off; its number is `_FIRST_END` higher."""
    found: list[Lane] = []
    for lane in lanes:
        if lane.successors or len(lane.centre) <= 2 * _END_ROWS:
            found.append(lane)
            continue
        end = _FIRST_END + lane.index
        found.append(replace(lane, centre=lane.centre[:-_END_ROWS], successors=(end,)))
        found.append(replace(lane, index=end, centre=lane.centre[-_END_ROWS - 1 :], junction=False))
    return found


def _junctions(lanes: Sequence[Lane]) -> dict[int, list[int]]:
    """The lanes inside each junction: those flagged so, and all that follow a lane which leads to more than one."""
    home: dict[int, int] = {}

    def find(road: int) -> int:
        while home.setdefault(road, road) != road:
            road = home[road]
        return road

    for lane in lanes:
        if lane.junction:
            find(lane.index)
        if len(lane.successors) > 1:
            for after in lane.successors[1:]:
                home[find(after)] = find(lane.successors[0])
    groups: dict[int, list[int]] = {}
    for road in sorted(home):
        groups.setdefault(find(road), []).append(road)
    return {_FIRST_JUNCTION + number: groups[road] for number, road in enumerate(sorted(groups))}


def _road(lane: Lane, inside: Mapping[int, int], before: int | None) -> Iterator[str]:
    geometry, length_m = _geometry(lane)
    if not geometry:
        return
    yield f'<road name="lane {lane.index}" length="{length_m:.6f}" id="{lane.index}" junction="{_own(lane, inside)}">'
    yield "<link>"
    if before is not None:
        yield f'<predecessor elementType="road" elementId="{before}" contactPoint="end"/>'
    if len(lane.successors) == 1 and lane.successors[0] not in inside:
        yield f'<successor elementType="road" elementId="{lane.successors[0]}" contactPoint="start"/>'
    elif lane.successors:
        yield f'<successor elementType="junction" elementId="{inside[lane.successors[0]]}"/>'
    yield "</link>"
    yield f'<type s="0.0" type="town"><speed max="{lane.speed_limit_mps * 3.6:.3f}" unit="km/h"/></type>'
    yield f"<planView>{''.join(geometry)}</planView>"
    yield '<elevationProfile><elevation s="0" a="0" b="0" c="0" d="0"/></elevationProfile>'
    yield f'<lanes><laneSection s="0.0"><center><lane id="0" type="none" level="false">{_mark(lane.left_line)}</lane>'
    yield f'</center><right><lane id="-1" type="{_TYPES[lane.kind]}" level="false"><link>'
    yield '<predecessor id="-1"/>' if before is not None else ""
    yield '<successor id="-1"/>' if lane.successors else ""
    yield f'</link><width sOffset="0" a="{lane.width_m:.4f}" b="0" c="0" d="0"/>{_mark(lane.right_line)}'
    yield "</lane></right></laneSection></lanes></road>"


def _own(lane: Lane, inside: Mapping[int, int]) -> int:
    return inside.get(lane.index, -1)


def _geometry(lane: Lane) -> tuple[list[str], float]:
    """Straight pieces along the left edge of the lane."""
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
    kind = _MARKS.get(line, "none")
    return f'<roadMark sOffset="0" type="{kind}" weight="standard" color="standard" width="0.12" laneChange="none"/>'


def _junction(number: int, group: Sequence[int], lanes: Sequence[Lane]) -> Iterator[str]:
    yield f'<junction id="{number}" name="junction {number}">'
    ways = [(lane.index, after) for lane in lanes for after in lane.successors if after in group]
    for way, (comes, goes) in enumerate(ways):
        yield (
            f'<connection id="{way}" incomingRoad="{comes}" connectingRoad="{goes}" contactPoint="start">'
            '<laneLink from="-1" to="-1"/></connection>'
        )
    yield "</junction>"
