"""Read a `LaneMap` from a live highway-env road network, for cameras and privileged agents."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from highway_env.road.lane import AbstractLane
from highway_env.road.road import RoadNetwork

from pytest_drive_robust.domain.truth import Lane, LaneKind, LaneMap
from pytest_drive_robust.jit.arrays import Floats

LaneKey = tuple[Any, Any, int]
"""highway-env's name of a lane: from node, to node, number."""

DEFAULT_LIMIT_MPS = 15.0
"""Speed limit of lanes without a limit."""
_LINES = {0: "none", 1: "striped", 2: "solid", 3: "solid"}
_LONG_M = 1500.0
_SEEN_BEHIND_M, _SEEN_AHEAD_M = 300.0, 500.0
_JOIN_M = 2.5
_TOUCH_M = 0.6
_NO_NEIGHBOUR = (-1, False)


def read_map(network: RoadNetwork, around: Floats, *, name: str) -> tuple[LaneMap, dict[LaneKey, int]]:
    """Return the lanes of `network` near the points `around` (n, 2 or more), and their indices by highway-env's keys.

    Lanes longer than 1.5 km (those of highway-v0 have 10 km) are sampled only where the route passes.
    """
    lanes: dict[LaneKey, AbstractLane] = network.lanes_dict()
    index = {key: k for k, key in enumerate(lanes)}
    junctions = junction_keys(network)
    read = []
    for key, lane in lanes.items():
        centre = sample(lane, *_seen(lane, around))
        left, right = _NO_NEIGHBOUR, _NO_NEIGHBOUR
        if key not in junctions:
            others = {index[k]: other for k, other in lanes.items() if k != key and k not in junctions}
            left, right = _neighbours(lane, centre, others)
        after = (k for k, other in lanes.items() if k[0] == key[1] and _joins(lane, other))
        read.append(
            Lane(
                index=index[key],
                kind=LaneKind.DRIVING,
                centre=centre,
                width_m=float(lane.width_at(0.0)),
                speed_limit_mps=float(lane.speed_limit or DEFAULT_LIMIT_MPS),
                junction=key in junctions,
                left=left[0],
                right=right[0],
                left_same_way=left[1],
                right_same_way=right[1],
                left_line=_LINES[int(lane.line_types[0])],
                right_line=_LINES[int(lane.line_types[1])],
                successors=tuple(index[k] for k in after),
            )
        )
    return LaneMap(name, tuple(read), (), np.zeros((0, 4, 2)), np.zeros((0, 6))), index


def junction_keys(network: RoadNetwork) -> frozenset[LaneKey]:
    """Return the lanes in junctions, from where ways part to where ways meet; highway-env does not mark junctions."""
    entering: dict[Any, int] = {}
    for ends in network.graph.values():
        for node in ends:
            entering[node] = entering.get(node, 0) + 1
    return frozenset(
        key for key in network.lanes_dict() if len(network.graph.get(key[0], {})) > 1 and entering[key[1]] > 1
    )


def sample(lane: AbstractLane, start_m: float, end_m: float) -> Floats:
    """Return (n, 3) x, y, heading of the centre line between two places on the lane, about one point a metre."""
    count = max(2, round(abs(end_m - start_m)) + 1)
    at = np.linspace(start_m, end_m, count)
    return np.array([[*lane.position(s, 0.0), lane.heading_at(s)] for s in at], dtype=float)


def _seen(lane: AbstractLane, around: Floats) -> tuple[float, float]:
    """Return the (start, end) of the drawn part of a lane, in metres along the lane."""
    length = float(lane.length)
    if length <= _LONG_M:
        return 0.0, length
    along = [float(lane.local_coordinates(point[:2])[0]) for point in around[:: max(1, len(around) // 16)]]
    start, end = max(0.0, min(along) - _SEEN_BEHIND_M), min(length, max(along) + _SEEN_AHEAD_M)
    return (start, end) if end > start + 1.0 else (0.0, _LONG_M)


def _joins(lane: AbstractLane, after: AbstractLane) -> bool:
    gap = after.position(0.0, 0.0) - lane.position(lane.length, 0.0)
    turn = after.heading_at(0.0) - lane.heading_at(lane.length)
    return bool(math.hypot(*gap) < _JOIN_M and math.cos(turn) > 0.7)


def _neighbours(
    lane: AbstractLane, centre: Floats, others: dict[int, AbstractLane]
) -> tuple[tuple[int, bool], tuple[int, bool]]:
    """Return (left, right), each (index or -1, leads the same way): the lanes that touch `lane` at its middle."""
    x, y, heading = centre[len(centre) // 2]
    width = float(lane.width_at(0.0))
    best = {"left": (math.inf, _NO_NEIGHBOUR), "right": (math.inf, _NO_NEIGHBOUR)}
    for index, other in others.items():
        s, right_of_it = (float(value) for value in other.local_coordinates(np.array([x, y])))
        gap = abs(right_of_it)
        if not (0.0 <= s <= other.length and 0.5 < gap < (width + other.width_at(s)) / 2.0 + _TOUCH_M):
            continue
        same_way = math.cos(float(other.heading_at(s)) - heading) > 0.0
        side = "left" if (right_of_it > 0.0) is same_way else "right"
        if gap < best[side][0]:
            best[side] = (gap, (index, same_way))
    return best["left"][1], best["right"][1]
