"""A town compiled to arrays: lanes, named chains of lanes, ways through junctions, stop lines, buildings."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from math import fsum

import numpy as np

from pytest_drive_robust.domain.truth import Lane, LaneKind, LaneMap
from pytest_drive_robust.errors import UnknownNameError
from pytest_drive_robust.jit.arrays import Floats
from pytest_drive_robust.simulators.embedded.geometry import arc_lengths, resample
from pytest_drive_robust.simulators.embedded.towns import Town, build_town
from pytest_drive_robust.simulators.embedded.towns.lanes import draw_buildings, draw_lanes, stop_lines

_ALMOST_ROUND_RAD = math.radians(300.0)
"""Turn of a way that drives round a whole roundabout."""


class CompiledTown:
    """A town's `lane_map` with the data that routes and scenarios need.

    `chains` are named sequences of lane indices (`"road.f0"`, `"E.left0"`). `junctions` maps each junction lane to the
    number of its junction. `passages` are all ways of cars through the junctions.
    """

    def __init__(self, town: Town) -> None:
        lanes = draw_lanes(town)
        crosswalks = np.array(town.crosswalks).reshape(-1, 4, 2)
        self.lane_map = LaneMap(town.name, lanes, stop_lines(town, lanes), crosswalks, draw_buildings(town, lanes))
        self.chains = {name: tuple(chain) for name, chain in town.chains.items()}
        self.junctions = {k: lane.junction for k, lane in enumerate(town.lanes) if lane.junction >= 0}
        self.passages: tuple[Passage, ...] = _passages(lanes, self.junctions)
        self._anchors = dict(town.anchors)

    def lanes_of(self, chain: str) -> tuple[int, ...]:
        """Return the lanes of a named chain. Raises `UnknownNameError`."""
        if chain not in self.chains:
            raise UnknownNameError.of(f"chain of lanes of town {self.lane_map.name}", chain, self.chains)
        return self.chains[chain]

    def chain(self, name: str) -> Floats:
        """Return the centre line of a named chain of lanes from end to end. Raises `UnknownNameError`."""
        return join(self.lane_map, self.lanes_of(name))

    def anchor_m(self, name: str) -> float | None:
        """Return where on a chain its first junction begins, or else its style's feature: a bend, a parallel lane."""
        before = 0.0
        for k in self.lanes_of(name):
            if self.lane_map.lanes[k].junction:
                return before
            before += float(arc_lengths(self.lane_map.lanes[k].centre)[-1])
        return self._anchors.get(name)


@lru_cache(maxsize=64)
def compile_town(name: str) -> CompiledTown:
    """Draw and compile a town, once per process. Raises `RouteError` for a name that is not one of our towns."""
    return CompiledTown(build_town(name))


def leftmost(lane_map: LaneMap, lane: int) -> int:
    """Return the leftmost lane beside `lane` that leads the same way."""
    lanes = lane_map.lanes
    while lanes[lane].left >= 0 and lanes[lane].left_same_way:
        lane = lanes[lane].left
    return lane


def join(lane_map: LaneMap, lanes: tuple[int, ...]) -> Floats:
    """Return one centre line through several lanes that follow each other, resampled to equal steps."""
    return resample(np.concatenate([lane_map.lanes[k].centre for k in lanes]))


def follow(lane_map: LaneMap, lane: int) -> tuple[int, ...]:
    """Return the chain through `lane` from where its road begins to where it ends, straight on at junctions.

    A road begins where a junction ends. In a roundabout "straight on" is the exit opposite.
    """
    lanes, chain = lane_map.lanes, [lane]
    while ways := _ways_on(lanes, tuple(chain)):
        inside = [k for k in chain if lanes[k].junction] if lanes[chain[-1]].junction else []
        chain.extend(min(ways, key=lambda way: abs(turn_of(lanes, (*inside, *way)))))
    before = {k: other.index for other in lanes for k in other.successors if not other.junction}
    while (earlier := before.get(chain[0])) is not None and earlier not in chain:
        chain.insert(0, earlier)
    return tuple(chain)


def prolonged_chain(lane_map: LaneMap, chain: tuple[int, ...]) -> tuple[int, ...]:
    """Return a chain prolonged straight on before its first lane and after its last lane, to the road's ends."""
    before = follow(lane_map, chain[0])
    after = follow(lane_map, chain[-1]) if len(chain) > 1 else before
    return (*before[: before.index(chain[0])], *chain, *after[after.index(chain[-1]) + 1 :])


def lanes_across(lanes: tuple[Lane, ...], lane: Lane, side: str) -> Iterator[Lane]:
    """Yield the lanes to the `"left"` or `"right"` of a lane in order, up to the edge of the road."""
    for _ in lanes:
        index, same_way = lane.beside(side)
        if index < 0:
            return
        lane = lanes[index]
        yield lane
        if not same_way:  # left and right are swapped for a lane of the other direction
            side = "right" if side == "left" else "left"


def turn_of(lanes: tuple[Lane, ...], way: Iterable[int]) -> float:
    """Return the total turn of a sequence of lanes in radians, positive to the right."""
    return fsum(float(lanes[k].centre[-1, 2] - lanes[k].centre[0, 2]) for k in way)


def _ways_on(lanes: tuple[Lane, ...], chain: tuple[int, ...], way: tuple[int, ...] = ()) -> list[tuple[int, ...]]:
    """Return every way on from a chain, each up to the end of the junction that begins or goes on there."""
    found: list[tuple[int, ...]] = []
    for after in lanes[(*chain, *way)[-1]].successors:
        if after in chain or after in way:
            continue
        if lanes[after].junction:
            found.extend(_ways_on(lanes, chain, (*way, after)) or [(*way, after)])
        else:
            found.append((*way, after))
    return found


@dataclass(frozen=True, slots=True)
class Passage:
    """One way through junction number `junction`.

    Lane `enters` comes in with `heading_rad`, `inside` are the junction's lanes in order, and lane `leaves` leads out.
    `turn_rad` is the turn from start to end, positive to the right.
    """

    junction: int
    enters: int
    inside: tuple[int, ...]
    leaves: int
    heading_rad: float
    turn_rad: float


def _passages(lanes: tuple[Lane, ...], junctions: Mapping[int, int]) -> tuple[Passage, ...]:
    """Return every way of cars through every junction, without ways round a whole roundabout."""
    found: list[Passage] = []
    for lane in lanes:
        if lane.junction or lane.kind is not LaneKind.DRIVING:
            continue
        for *inside, leaves in _ways_on(lanes, (lane.index,)):
            turns = [turn_of(lanes, inside[:k]) for k in range(1, len(inside) + 1)]
            if inside and not lanes[leaves].junction and max(map(abs, turns)) <= _ALMOST_ROUND_RAD:
                heading = float(lane.centre[-1, 2])
                found.append(Passage(junctions[inside[0]], lane.index, tuple(inside), leaves, heading, turns[-1]))
    return tuple(found)
