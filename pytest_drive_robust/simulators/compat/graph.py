"""The lane graph: which lane comes next, and who is in front and behind on a lane."""

from __future__ import annotations

import math

import numba

from pytest_drive_robust.simulators.compat import columns as c
from pytest_drive_robust.simulators.compat.columns import Arrays
from pytest_drive_robust.simulators.compat.lanes import along, centre_point, coordinates, distance, is_on

__all__ = ["follow_road", "neighbours", "next_lane", "wanted_id"]

_jit = numba.njit(cache=True)


@_jit
def wanted_id(arrays: Arrays, body: int) -> int:
    """The lane id that a body's route asks for next, or NO_ID."""
    route = arrays.body_ints[body, c.I_ROUTE]
    if route < 0 or arrays.route_spans[route, 0] >= arrays.route_spans[route, 1]:
        return c.NO_ID
    return arrays.route_steps[arrays.route_spans[route, 0], c.R_ID]


@_jit
def _enter_edge(arrays: Arrays, lane: int, edge: int, asked_id: int, x: float, y: float) -> tuple[int, float]:
    """The lane of `edge` on which to go on after `lane`, and the distance of (x, y) to it.

    As many lanes as before: the same one (or the one that was asked for). Otherwise the closest.
    """
    first, count = arrays.edges[edge, c.E_FIRST], arrays.edges[edge, c.E_COUNT]
    if count == arrays.edges[arrays.lane_ints[lane, c.LI_EDGE], c.E_COUNT]:
        number = first + (arrays.lane_ints[lane, c.LI_ID] if asked_id == c.NO_ID else asked_id)
        s, lateral = coordinates(arrays, number, x, y)
        return number, distance(arrays, number, s, lateral)
    closest, best = first, math.inf
    for number in range(first, first + count):
        s, lateral = coordinates(arrays, number, x, y)
        far = distance(arrays, number, s, lateral)
        if far < best:
            closest, best = number, far
    return closest, best


@_jit
def _drop_finished_step(arrays: Arrays, route: int, edge: int) -> None:
    first = arrays.route_spans[route, 0]
    if first < arrays.route_spans[route, 1] and arrays.route_steps[first, c.R_EDGE] == edge:
        arrays.route_spans[route, 0] = first + 1


@_jit
def next_lane(arrays: Arrays, body: int, lane: int) -> int:
    """The lane after `lane`: along the body's route if it goes on from here, else the closest of all that leave."""
    edge = arrays.lane_ints[lane, c.LI_EDGE]
    node, route = arrays.edges[edge, c.E_TO], arrays.body_ints[body, c.I_ROUTE]
    x, y = centre_point(arrays, lane, along(arrays, lane, body))
    if route >= 0:
        _drop_finished_step(arrays, route, edge)
        first = arrays.route_spans[route, 0]
        if first < arrays.route_spans[route, 1]:
            step = arrays.route_steps[first]
            if arrays.edges[step[c.R_EDGE], c.E_FROM] == node:
                return _enter_edge(arrays, lane, step[c.R_EDGE], step[c.R_ID], x, y)[0]
    following, best = lane, math.inf
    leaving = arrays.nodes[node, c.N_LEAVING]
    for candidate in range(leaving, leaving + arrays.nodes[node, c.N_LEAVING_COUNT]):
        number, far = _enter_edge(arrays, lane, candidate, c.NO_ID, x, y)
        if far < best:
            following, best = number, far
    return following


@_jit
def follow_road(arrays: Arrays, body: int) -> None:
    """At the end of the target lane aim at the next one."""
    target = arrays.body_ints[body, c.I_TARGET_LANE]
    lane = arrays.lanes[target]
    if along(arrays, target, body) > lane[c.L_LENGTH] - lane[c.L_MARGIN] / 2:
        arrays.body_ints[body, c.I_TARGET_LANE] = next_lane(arrays, body, target)


@_jit
def _list_search_lanes(arrays: Arrays, lane: int) -> int:
    """Fill the scratch with `lane` and, when the road says so, the lanes before and after it; how many they are."""
    lanes, offsets = arrays.search_lanes, arrays.search_offsets
    lanes[0], offsets[0] = lane, 0.0
    count = 1
    if not arrays.connected:
        return count
    edge, place = arrays.edges[arrays.lane_ints[lane, c.LI_EDGE]], arrays.lane_ints[lane, c.LI_ID]
    after, before = arrays.nodes[edge[c.E_TO]], arrays.nodes[edge[c.E_FROM]]
    for k in range(after[c.N_LEAVING], after[c.N_LEAVING] + after[c.N_LEAVING_COUNT]):
        lanes[count] = arrays.edges[k, c.E_FIRST] + (place if place < arrays.edges[k, c.E_COUNT] else 0)
        offsets[count] = arrays.lanes[lane, c.L_LENGTH]
        count += 1
    for j in range(before[c.N_ENTERING], before[c.N_ENTERING] + before[c.N_ENTERING_COUNT]):
        k = arrays.entering[j]
        lanes[count] = arrays.edges[k, c.E_FIRST] + (place if place < arrays.edges[k, c.E_COUNT] else 0)
        offsets[count] = -arrays.lanes[lanes[count], c.L_LENGTH]
        count += 1
    return count


@_jit
def neighbours(arrays: Arrays, body: int, lane: int) -> tuple[int, int]:
    """The bodies directly in front of and behind `body` on a lane (landmarks are not seen), or -1."""
    searched = _list_search_lanes(arrays, lane)
    s = along(arrays, lane, body)
    front, rear, s_front, s_rear = -1, -1, math.inf, -math.inf
    for other in range(arrays.bodies.shape[0]):
        if other == body or arrays.body_ints[other, c.I_KIND] == c.LANDMARK:
            continue
        for k in range(searched):
            if not is_on(arrays, arrays.search_lanes[k], other, 1.0):
                continue
            s_other = along(arrays, arrays.search_lanes[k], other) + arrays.search_offsets[k]
            if s <= s_other and (front < 0 or s_other <= s_front):
                front, s_front = other, s_other
            if s_other < s and (rear < 0 or s_other > s_rear):
                rear, s_rear = other, s_other
            break
    return front, rear
