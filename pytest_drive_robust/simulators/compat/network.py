"""highway-env's lane graph as arrays."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from highway_env.road.road import RoadNetwork

from pytest_drive_robust.errors import SimulationError
from pytest_drive_robust.simulators.compat import columns as c
from pytest_drive_robust.simulators.compat.known import lane_kind

__all__ = ["LaneIndex", "Network"]

LaneIndex = tuple[str, str, int]


@dataclass(frozen=True, slots=True)
class Network:
    """The lanes and edges of a `RoadNetwork` in the order in which highway-env walks through them.

    `indices[k]` and `lanes[k]` belong to row k of `lane_floats` (L, LANE_FLOATS) and `lane_ints` (L, LANE_INTS);
    `edge_numbers` gives the row of `edges` (E, EDGE_INTS) of a pair of nodes; `search` as in `columns`.
    """

    indices: tuple[LaneIndex, ...]
    lanes: tuple[Any, ...]
    edge_numbers: dict[tuple[str, str], int]
    lane_floats: c.Floats
    lane_ints: c.Ints
    edges: c.Ints
    search: c.Floats

    @classmethod
    def from_road_network(cls, network: RoadNetwork, *, connected: bool) -> Network:
        """Read a live network; `connected`: neighbours are searched on the lanes before and after too.

        Raises `SimulationError` for a lane class that the kernels do not know.
        """
        pairs = [(start, end) for start, ends in network.graph.items() for end in ends]
        groups = [network.graph[start][end] for start, end in pairs]
        edges = _edges(pairs, [len(group) for group in groups])
        lanes = [(number, place, lane) for number, group in enumerate(groups) for place, lane in enumerate(group)]
        kinds = [lane_kind(lane) for _, _, lane in lanes]
        floats = [_lane_row(lane, kind) for (_, _, lane), kind in zip(lanes, kinds, strict=True)]
        ints: list[tuple[int, ...]] = []
        search: list[tuple[int, float]] = []
        for row, ((number, place, lane), kind) in enumerate(zip(lanes, kinds, strict=True)):
            searched = _searched(row, place, edges, edges[number], floats) if connected else [(row, 0.0)]
            ints.append((kind, number, place, bool(lane.forbidden), len(search), len(search) + len(searched)))
            search += searched
        return cls(
            indices=tuple((*pairs[number], place) for number, place, _ in lanes),
            lanes=tuple(lane for _, _, lane in lanes),
            edge_numbers={pair: number for number, pair in enumerate(pairs)},
            lane_floats=np.array(floats, dtype=np.float64).reshape(-1, c.LANE_FLOATS),
            lane_ints=np.array(ints, dtype=np.int64).reshape(-1, c.LANE_INTS),
            edges=edges,
            search=np.array(search, dtype=np.float64).reshape(-1, c.SEARCH_FLOATS),
        )

    def edge(self, start: str, end: str) -> int:
        """The row of the edge between two nodes. Raises `SimulationError` where there is none."""
        number = self.edge_numbers.get((start, end))
        if number is None:
            raise SimulationError(
                f"A route of the road leads from {start!r} to {end!r}, where the network has no lane."
            )
        return number

    def lane(self, index: LaneIndex) -> int:
        """The row of a lane index; an id of None means the only lane of its edge."""
        start, end, place = index
        row = self.edges[self.edge(start, end)]
        if place is None and row[c.E_COUNT] == 1:
            place = 0
        if place is None or not 0 <= place < row[c.E_COUNT]:
            raise SimulationError(
                f"The lane index {index!r} of a vehicle asks for an id from 0 to {row[c.E_COUNT] - 1}."
            )
        return int(row[c.E_FIRST] + place)


def _edges(pairs: list[tuple[str, str]], counts: list[int]) -> c.Ints:
    """(E, EDGE_INTS). The edges that leave a node follow each other, as in the graph's dictionaries."""
    names = {name: node for node, name in enumerate(dict.fromkeys(name for pair in pairs for name in pair))}
    starts = [start for start, _ in pairs]
    rows = [
        (
            names[start],
            names[end],
            sum(counts[:number]),
            counts[number],
            starts.index(end) if end in starts else 0,
            starts.count(end),
        )
        for number, (start, end) in enumerate(pairs)
    ]
    return np.array(rows, dtype=np.int64).reshape(-1, c.EDGE_INTS)


def _searched(
    lane: int, place: int, edges: c.Ints, own: c.Ints, floats: list[c.Floats]
) -> list[tuple[int, float]]:  # fmt: skip
    """The lanes around `lane` on which its neighbours may be, in highway-env's order, with their offsets [m]."""
    after = [_beside(edge, place) for edge in edges[own[c.E_NEXT] : own[c.E_NEXT] + own[c.E_NEXT_COUNT]]]
    before = [_beside(edge, place) for edge in edges[edges[:, c.E_TO] == own[c.E_FROM]]]
    return [
        (lane, 0.0),
        *((number, floats[lane][c.L_LENGTH]) for number in after),
        *((number, -floats[number][c.L_LENGTH]) for number in before),
    ]


def _beside(edge: c.Ints, place: int) -> int:
    """The lane of an edge with the id `place`, or its first one."""
    return int(edge[c.E_FIRST]) + (place if place < edge[c.E_COUNT] else 0)


def _lane_row(lane: Any, kind: int) -> c.Floats:
    row = np.zeros(c.LANE_FLOATS)
    row[c.L_LENGTH], row[c.L_WIDTH], row[c.L_MARGIN] = lane.length, lane.width, lane.VEHICLE_LENGTH
    row[c.L_SPEED_LIMIT] = math.nan if lane.speed_limit is None else lane.speed_limit
    if kind == c.CIRCLE:
        row[[c.L_X, c.L_Y]] = lane.center
        row[[c.L_RADIUS, c.L_START_PHASE, c.L_TURN]] = lane.radius, lane.start_phase, lane.direction
        return row
    row[[c.L_X, c.L_Y]], row[c.L_HEADING] = lane.start, lane.heading
    row[[c.L_ALONG_X, c.L_ALONG_Y]], row[[c.L_RIGHT_X, c.L_RIGHT_Y]] = lane.direction, lane.direction_lateral
    if kind == c.SINE:
        row[[c.L_AMPLITUDE, c.L_PULSATION, c.L_PHASE]] = lane.amplitude, lane.pulsation, lane.phase
    return row
