"""Ways through junctions: which lane leads in, over which lanes, and out where."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from math import fsum

from pytest_drive_robust.domain.truth import Lane, LaneKind

__all__ = ["Passage", "find_passages"]

_ALMOST_ROUND_RAD = math.radians(300.0)
"""Who turned so far has driven round a roundabout."""


@dataclass(frozen=True, slots=True)
class Passage:
    """One way through junction number `junction`.

    Lane `enters` comes in with `heading_rad`, `inside` are the junction's lanes in order, lane `leaves` leads out;
    `turn_rad` is the turn from start to end, positive to the right.
    """

    junction: int
    enters: int
    inside: tuple[int, ...]
    leaves: int
    heading_rad: float
    turn_rad: float


def find_passages(lanes: tuple[Lane, ...], junctions: Mapping[int, int]) -> tuple[Passage, ...]:
    """Return every way of cars through every junction.

    `junctions` maps junction lanes to the number of their junction.
    """
    found: list[Passage] = []
    for lane in lanes:
        if lane.junction or lane.kind is not LaneKind.DRIVING:
            continue
        for first in lane.successors:
            if lanes[first].junction:
                found.extend(_ways_on(lanes, junctions, lane, (first,)))
    return tuple(found)


def _ways_on(
    lanes: tuple[Lane, ...], junctions: Mapping[int, int], enters: Lane, inside: tuple[int, ...]
) -> Iterator[Passage]:
    turn = fsum(float(lanes[k].centre[-1, 2] - lanes[k].centre[0, 2]) for k in inside)
    if abs(turn) > _ALMOST_ROUND_RAD:
        return
    for after in lanes[inside[-1]].successors:
        if not lanes[after].junction:
            heading = float(enters.centre[-1, 2])
            yield Passage(junctions[inside[0]], enters.index, inside, after, heading, turn)
        elif after not in inside:
            yield from _ways_on(lanes, junctions, enters, (*inside, after))
