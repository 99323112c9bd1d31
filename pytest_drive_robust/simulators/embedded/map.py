"""A town compiled to arrays: lanes, named chains of lanes, ways through junctions, stop lines, buildings."""

from __future__ import annotations

from functools import lru_cache
from math import fsum

import numpy as np
from numpy.typing import NDArray

from pytest_drive_robust.domain.truth import LaneMap
from pytest_drive_robust.errors import UnknownNameError
from pytest_drive_robust.simulators.embedded.geometry import arc_lengths, resample
from pytest_drive_robust.simulators.embedded.passages import Passage, find_passages
from pytest_drive_robust.simulators.embedded.towns import Town, build_town
from pytest_drive_robust.simulators.embedded.towns.buildings import draw_buildings
from pytest_drive_robust.simulators.embedded.towns.lanes import draw_lanes, stop_lines

__all__ = ["CompiledTown", "compile_town", "follow", "join"]

Floats = NDArray[np.float64]


class CompiledTown:
    """`lane_map` plus what routes and scenarios want to know of a town.

    `chains` are named rows of lane indices (`"road.f0"`, `"E.left0"`), `junctions` the number of the junction of each
    junction lane, `passages` every way of cars through the junctions.
    """

    def __init__(self, town: Town) -> None:
        index = {key: k for k, key in enumerate(town.kinds)}
        lanes = draw_lanes(town)
        crosswalks = np.array(town.crosswalks).reshape(-1, 4, 2)
        self.lane_map = LaneMap(town.name, lanes, stop_lines(town, lanes), crosswalks, draw_buildings(town, lanes))
        self.chains = {name: tuple(index[key] for key in chain) for name, chain in town.chains.items()}
        self.junctions = {index[key]: number for key, number in town.junctions.items()}
        self.passages: tuple[Passage, ...] = find_passages(lanes, self.junctions)
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
    """Draw and compile a town once per process. Raises `RouteError` for a name that is none of ours."""
    return CompiledTown(build_town(name))


def join(lane_map: LaneMap, lanes: tuple[int, ...]) -> Floats:
    """Return one centre line through several lanes that follow each other, resampled to equal steps."""
    return resample(np.concatenate([lane_map.lanes[k].centre for k in lanes]))


def follow(lane_map: LaneMap, lane: int) -> tuple[int, ...]:
    """Return the chain through `lane` from where its road begins to where it ends, straight on at junctions.

    A road begins where a junction ends. In a roundabout "straight on" is the exit opposite.
    """
    chain = [lane]
    while onward := _straightest(lane_map, tuple(chain)):
        chain.extend(onward)
    before = {k: other.index for other in lane_map.lanes for k in other.successors if not other.junction}
    while (earlier := before.get(chain[0])) is not None and earlier not in chain:
        chain.insert(0, earlier)
    return tuple(chain)


def _straightest(lane_map: LaneMap, chain: tuple[int, ...]) -> tuple[int, ...]:
    """Return the lanes that follow a chain up to the end of the junction that begins or goes on there.

    () at the end.
    """
    ways = _ways_on(lane_map, chain)
    return min(ways, key=lambda way: abs(_turn(lane_map, chain, way)), default=())


def _turn(lane_map: LaneMap, chain: tuple[int, ...], way: tuple[int, ...]) -> float:
    inside = [k for k in chain if lane_map.lanes[k].junction] if lane_map.lanes[chain[-1]].junction else []
    return fsum(float(lane_map.lanes[k].centre[-1, 2] - lane_map.lanes[k].centre[0, 2]) for k in (*inside, *way))


def _ways_on(lane_map: LaneMap, chain: tuple[int, ...], way: tuple[int, ...] = ()) -> list[tuple[int, ...]]:
    found: list[tuple[int, ...]] = []
    for after in lane_map.lanes[(*chain, *way)[-1]].successors:
        if after in chain or after in way:
            continue
        if lane_map.lanes[after].junction:
            found.extend(_ways_on(lane_map, chain, (*way, after)) or [(*way, after)])
        else:
            found.append((*way, after))
    return found
