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
    `edge_numbers` gives the row of `edges` (E, EDGE_INTS) of a pair of nodes; `nodes` and `entering` as in `columns`.
    """

    indices: tuple[LaneIndex, ...]
    lanes: tuple[Any, ...]
    edge_numbers: dict[tuple[str, str], int]
    lane_floats: c.Floats
    lane_ints: c.Ints
    edges: c.Ints
    nodes: c.Ints
    entering: c.Ints

    @classmethod
    def from_road_network(cls, network: RoadNetwork) -> Network:
        """Read a live network. Raises `SimulationError` for a lane class that the kernels do not know."""
        pairs = [(start, end) for start, ends in network.graph.items() for end in ends]
        names = {name: k for k, name in enumerate(dict.fromkeys(name for pair in pairs for name in pair))}
        edges, floats, ints, indices, lanes = [], [], [], [], []
        for number, (start, end) in enumerate(pairs):
            group = network.graph[start][end]
            edges.append((names[start], names[end], len(lanes), len(group)))
            for place, lane in enumerate(group):
                kind = lane_kind(lane)
                floats.append(_lane_row(lane, kind))
                ints.append((kind, number, place, int(bool(lane.forbidden))))
                indices.append((start, end, place))
                lanes.append(lane)
        nodes, entering = _nodes(edges, len(names))
        return cls(
            indices=tuple(indices),
            lanes=tuple(lanes),
            edge_numbers={pair: number for number, pair in enumerate(pairs)},
            lane_floats=np.array(floats, dtype=np.float64).reshape(-1, c.LANE_FLOATS),
            lane_ints=np.array(ints, dtype=np.int64).reshape(-1, c.LANE_INTS),
            edges=np.array(edges, dtype=np.int64).reshape(-1, c.EDGE_INTS),
            nodes=nodes,
            entering=entering,
        )

    def edge(self, start: str, end: str) -> int:
        """The row of the edge between two nodes. Raises `SimulationError` where there is none."""
        number = self.edge_numbers.get((start, end))
        if number is None:
            raise SimulationError(f"A route of the road leads from {start!r} to {end!r}, where the network has no lane.")
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


def _nodes(edges: list[tuple[int, int, int, int]], count: int) -> tuple[c.Ints, c.Ints]:
    nodes = np.zeros((count, c.NODE_INTS), dtype=np.int64)
    entering: list[int] = []
    for node in range(count):
        leaving = [k for k, edge in enumerate(edges) if edge[c.E_FROM] == node]
        arriving = [k for k, edge in enumerate(edges) if edge[c.E_TO] == node]
        nodes[node] = (leaving[0] if leaving else 0, len(leaving), len(entering), len(arriving))
        entering += arriving
    return nodes, np.array(entering, dtype=np.int64)


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
