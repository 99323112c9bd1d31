"""A town compiled to arrays: lanes sampled every metre, neighbours, successors, stop lines, buildings."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from pytest_drive_robust.domain.truth import Lane, LaneKind, LaneMap, StopLine
from pytest_drive_robust.simulators.embedded.geometry import arc_lengths, place, resample
from pytest_drive_robust.simulators.embedded.towns import LaneKey, Town, build_town

__all__ = ["CompiledTown", "compile_town", "follow", "join"]

Floats = NDArray[np.float64]
_LINES = {0: "none", 1: "striped", 2: "solid", 3: "solid"}
_JOIN_M = 0.5
"""Two lanes follow each other when end and start are nearer than this."""


class CompiledTown:
    """`lane_map` plus the named chains of lanes (`"road.f0"`, `"E.left0"`) as lane indices."""

    def __init__(self, town: Town) -> None:
        keys = list(town.kinds)
        index = {key: k for k, key in enumerate(keys)}
        centres = [_sample(town, key) for key in keys]
        neighbours = _neighbours(town, keys, centres)
        lanes = tuple(_lane(town, keys, k, centres, neighbours) for k in range(len(keys)))
        stops = tuple(_stop_line(k, lanes[index[key]], what, lanes) for k, (key, what) in enumerate(town.controls))
        crosswalks = np.array(town.crosswalks).reshape(-1, 4, 2)
        buildings = _buildings(town, centres, [lane.width_m for lane in lanes])
        self.lane_map = LaneMap(town.name, lanes, stops, crosswalks, buildings)
        self.chains = {name: tuple(index[key] for key in chain) for name, chain in town.chains.items()}

    def chain(self, name: str) -> Floats:
        """The centre line of a named chain of lanes from end to end."""
        return join(self.lane_map, self.chains[name])


@lru_cache(maxsize=64)
def compile_town(name: str) -> CompiledTown:
    """Draw and compile a town once per process. Raises `RouteError` for a name that is none of ours."""
    return CompiledTown(build_town(name))


def join(lane_map: LaneMap, lanes: tuple[int, ...]) -> Floats:
    """One centre line through several lanes that follow each other, resampled to equal steps."""
    return resample(np.concatenate([lane_map.lanes[k].centre for k in lanes]))


def follow(lane_map: LaneMap, lane: int) -> tuple[int, ...]:
    """The chain through `lane` from where its road begins to where it ends, straight on at junctions."""
    chain = [lane]
    while (after := _straightest(lane_map, chain[-1])) is not None and after not in chain:
        chain.append(after)
    before = {k: other.index for other in lane_map.lanes for k in other.successors if not other.junction}
    while (earlier := before.get(chain[0])) is not None and earlier not in chain:
        chain.insert(0, earlier)
    return tuple(chain)


def _straightest(lane_map: LaneMap, lane: int) -> int | None:
    options = lane_map.lanes[lane].successors
    if not options:
        return None

    def turn(k: int) -> float:
        centre = lane_map.lanes[k].centre
        return abs(float(centre[-1, 2] - centre[0, 2]))

    return min(options, key=turn)


def _sample(town: Town, key: LaneKey) -> Floats:
    lane = town.network.get_lane(key)
    count = max(2, round(lane.length) + 1)
    at = np.linspace(0.0, lane.length, count)
    return np.array([[*lane.position(s, 0.0), lane.heading_at(s)] for s in at], dtype=float)


def _lane(town: Town, keys: list[LaneKey], k: int, centres: list[Floats], neighbours: Floats) -> Lane:
    key = keys[k]
    lane = town.network.get_lane(key)
    left, right = int(neighbours[k, 0]), int(neighbours[k, 2])
    kind = town.kinds[key]
    end = centres[k][-1]
    successors = tuple(
        other
        for other, centre in enumerate(centres)
        if other != k
        and town.kinds[keys[other]] is kind
        and np.hypot(*(centre[0, :2] - end[:2])) < _JOIN_M
        and np.cos(centre[0, 2] - end[2]) > 0.9
    )
    return Lane(
        index=k,
        kind=kind,
        centre=centres[k],
        width_m=float(lane.width_at(0.0)),
        speed_limit_mps=float(lane.speed_limit),
        junction=key in town.junctions,
        left=left,
        right=right,
        left_same_way=bool(neighbours[k, 1]),
        right_same_way=bool(neighbours[k, 3]),
        left_line=_LINES[int(lane.line_types[0])],
        right_line=_LINES[int(lane.line_types[1])],
        successors=successors,
    )


def _neighbours(town: Town, keys: list[LaneKey], centres: list[Floats]) -> Floats:
    """(lanes, 4): left lane or -1, leads the same way, right lane or -1, leads the same way."""
    found = np.tile(np.array([-1.0, 0.0, -1.0, 0.0]), (len(keys), 1))
    widths = [float(town.network.get_lane(key).width_at(0.0)) for key in keys]
    for k, key in enumerate(keys):
        if key in town.junctions:
            continue
        x, y, heading = centres[k][len(centres[k]) // 2]
        best = [np.inf, np.inf]
        for other, centre in enumerate(centres):
            if other == k or keys[other] in town.junctions:
                continue
            near = int(np.argmin(np.hypot(centre[:, 0] - x, centre[:, 1] - y)))
            dx, dy = centre[near, 0] - x, centre[near, 1] - y
            ahead = dx * np.cos(heading) + dy * np.sin(heading)
            beside = -dx * np.sin(heading) + dy * np.cos(heading)
            touching = abs(beside) < (widths[k] + widths[other]) / 2.0 + 0.4
            side = 0 if beside < 0 else 1
            if abs(ahead) < 1.5 and abs(beside) > 0.5 and touching and abs(beside) < best[side]:
                best[side] = abs(beside)
                found[k, 2 * side] = other
                found[k, 2 * side + 1] = float(np.cos(centre[near, 2] - heading) > 0.0)
    return found


def _stop_line(k: int, lane: Lane, what: str, lanes: tuple[Lane, ...]) -> StopLine:
    """At the end of the lane, 5 m before the junction box so that the crosswalk stays free.

    A light stands at the far corner of the junction, where a driver at the line can see it; a sign stands at the line.
    Both stand to the right of the outermost lane.
    """
    length = arc_lengths(lane.centre)[-1]
    x, y, heading = place(lane.centre, length - 5.0)
    to_right, to_left = _same_way(lanes, lane, "right"), _same_way(lanes, lane, "left")
    edge = (to_right + 0.5) * lane.width_m
    if what == "light":
        half_box = max(arc_lengths(lanes[after].centre)[-1] for after in lane.successors) / 2.0
        pole = place(lane.centre, length + half_box + (to_left + 1 + to_right) * lane.width_m + 1.0, edge + 2.0)
    else:
        pole = place(lane.centre, length - 4.5, edge + 1.0)
    return StopLine(k, lane.index, x, y, heading, lane.width_m, what == "light", pole[0], pole[1])


def _same_way(lanes: tuple[Lane, ...], lane: Lane, side: str) -> int:
    """How many driving lanes of the same way lie to that side."""
    count = 0
    while True:
        index, same_way = (lane.left, lane.left_same_way) if side == "left" else (lane.right, lane.right_same_way)
        if index < 0 or not same_way or lanes[index].kind is not LaneKind.DRIVING:
            return count
        lane, count = lanes[index], count + 1


def _buildings(town: Town, centres: list[Floats], widths: list[float]) -> Floats:
    """Boxes beside the sidewalks, none nearer to any lane than the town's gap allows: (b, 6)."""
    rng = np.random.Generator(np.random.Philox(key=[sum(map(ord, town.name)), 0x6275]))
    points = np.concatenate([centre[:, :2] for centre in centres])
    radii = np.concatenate([np.full(len(centre), width / 2.0) for centre, width in zip(centres, widths, strict=True)])
    rows: list[list[float]] = []
    for key, centre in zip(town.kinds, centres, strict=True):
        if town.kinds[key] is not LaneKind.SIDEWALK and town.building_gap_m < 20.0:
            continue
        for start in range(5, len(centre) - 12, 22):
            length, depth, height = rng.uniform(12.0, 19.0), rng.uniform(8.0, 14.0), rng.uniform(6.0, 18.0)
            gap = rng.uniform(2.0, town.building_gap_m)
            x, y, heading = place(centre, float(start + 8), gap + depth / 2.0 + 1.5)
            reach = np.hypot(length, depth) / 2.0
            clear = np.hypot(points[:, 0] - x, points[:, 1] - y) > radii + depth / 2.0 + 1.0
            apart = all(np.hypot(x - r[0], y - r[1]) > reach + np.hypot(r[3], r[4]) / 2.0 - 4.0 for r in rows)
            if bool(clear.all()) and apart:
                rows.append([x, y, heading, float(length), float(depth), float(height)])
    return np.array(rows, dtype=float).reshape(-1, 6)
