"""The lane graph: which lane comes next, and who is in front and behind on a lane."""

from __future__ import annotations

import math

from pytest_drive_robust.simulators.compat import columns as c
from pytest_drive_robust.simulators.compat.columns import Arrays
from pytest_drive_robust.simulators.compat.compiled import part
from pytest_drive_robust.simulators.compat.lanes import along, centre_point, coordinates, distance, is_on

__all__ = ["follow_road", "neighbours", "next_lane", "wanted_id"]


@part
def wanted_id(arrays: Arrays, body: int) -> int:
    """The lane id that a body's route asks for next, or NO_ID."""
    route = arrays.body_ints[body, c.I_ROUTE]
    if route < 0 or arrays.routes[route, c.R_FIRST] >= arrays.routes[route, c.R_END]:
        return c.NO_ID
    return int(arrays.routes[arrays.routes[route, c.R_FIRST], c.R_ID])


@part
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


@part
def _drop_finished_step(arrays: Arrays, route: int, edge: int) -> None:
    first = arrays.routes[route, c.R_FIRST]
    if first < arrays.routes[route, c.R_END] and arrays.routes[first, c.R_EDGE] == edge:
        arrays.routes[route, c.R_FIRST] = first + 1


@part
def next_lane(arrays: Arrays, body: int, lane: int) -> int:
    """The lane after `lane`: along the body's route if it goes on from here, else the closest of all that leave."""
    edge = arrays.lane_ints[lane, c.LI_EDGE]
    node, route = arrays.edges[edge, c.E_TO], arrays.body_ints[body, c.I_ROUTE]
    x, y = centre_point(arrays, lane, along(arrays, lane, body))
    if route >= 0:
        _drop_finished_step(arrays, route, edge)
        first = arrays.routes[route, c.R_FIRST]
        if first < arrays.routes[route, c.R_END]:
            step = arrays.routes[first]
            if arrays.edges[step[c.R_EDGE], c.E_FROM] == node:
                return _enter_edge(arrays, lane, step[c.R_EDGE], step[c.R_ID], x, y)[0]
    following, best = lane, math.inf
    leaving = arrays.edges[edge, c.E_NEXT]
    for candidate in range(leaving, leaving + arrays.edges[edge, c.E_NEXT_COUNT]):
        number, far = _enter_edge(arrays, lane, candidate, c.NO_ID, x, y)
        if far < best:
            following, best = number, far
    return following


@part
def follow_road(arrays: Arrays, body: int) -> None:
    """At the end of the target lane aim at the next one."""
    target = arrays.body_ints[body, c.I_TARGET_LANE]
    lane = arrays.lanes[target]
    if along(arrays, target, body) > lane[c.L_LENGTH] - lane[c.L_MARGIN] / 2:
        arrays.body_ints[body, c.I_TARGET_LANE] = next_lane(arrays, body, target)


@part
def neighbours(arrays: Arrays, body: int, lane: int) -> tuple[int, int]:
    """The bodies directly in front of and behind `body` on a lane (landmarks are not seen), or -1."""
    first, end = arrays.lane_ints[lane, c.LI_SEARCH], arrays.lane_ints[lane, c.LI_SEARCH_END]
    s = along(arrays, lane, body)
    front, rear, s_front, s_rear = -1, -1, math.inf, -math.inf
    for other in range(arrays.bodies.shape[0]):
        if other == body or arrays.body_ints[other, c.I_KIND] == c.LANDMARK:
            continue
        for k in range(first, end):
            searched = int(arrays.search[k, c.S_LANE])
            if not is_on(arrays, searched, other, 1.0):
                continue
            s_other = along(arrays, searched, other) + arrays.search[k, c.S_OFFSET]
            if s <= s_other and (front < 0 or s_other <= s_front):
                front, s_front = other, s_other
            if s_other < s and (rear < 0 or s_other > s_rear):
                rear, s_rear = other, s_other
            break
    return front, rear
