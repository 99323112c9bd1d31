"""Draw the route along an itinerary: one row per metre with a command each, and the sparse plan."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from highway_env.road.road import RoadNetwork

from pytest_drive_robust.domain.route import GlobalPlan, PlanPoint, RoadOption
from pytest_drive_robust.jit.arrays import Floats
from pytest_drive_robust.simulators.embedded.geometry import arc_lengths, resample
from pytest_drive_robust.simulators.gymnasium.itinerary import Itinerary
from pytest_drive_robust.simulators.gymnasium.road_map import DEFAULT_LIMIT_MPS, LaneKey, sample

_CHANGE_SHARE = 0.8
_SHORTEST_M = 10.0
_STEP_M = 0.3


@dataclass(frozen=True, slots=True)
class RouteLine:
    """A route by rows: `rows` (n, 4) x, y, yaw, speed limit; `s` (n,) metres along it; `keys`, `commands` per row."""

    rows: Floats
    s: Floats
    keys: tuple[LaneKey, ...]
    commands: tuple[RoadOption, ...]

    @property
    def length_m(self) -> float:
        """Length of the route in metres."""
        return float(self.s[-1])

    def plan(self) -> GlobalPlan:
        """Return the sparse plan, as the leaderboard downsamples it."""
        places = zip(self.rows[:, :2].tolist(), self.commands, strict=True)
        return GlobalPlan.of([PlanPoint(x, y, command) for (x, y), command in places], self.s.tolist())


@dataclass(frozen=True, slots=True)
class _Piece:
    """A stretch of the line on one road. `points` is (n, 3)."""

    points: Floats
    key: LaneKey
    command: RoadOption


def draw_line(network: RoadNetwork, itinerary: Itinerary, start: Floats, junctions: frozenset[LaneKey]) -> RouteLine:
    """Return the line along `itinerary` from beside the ego at `start` (x, y) on."""
    pieces: list[_Piece] = []
    lanes = itinerary.lanes
    position = max(0.0, float(network.get_lane(lanes[0]).local_coordinates(start)[0]))
    for begin, end in _roads(lanes):
        lane = network.get_lane(lanes[end - 1])
        stop = max(itinerary.end_m, position + _SHORTEST_M) if end == len(lanes) else float(lane.length)
        if stop - position > 1.0:
            pieces += _along_road(network, lanes[begin:end], (position, stop), junctions)
        position = 0.0
    return _joined(network, pieces)


def _roads(lanes: tuple[LaneKey, ...]) -> list[tuple[int, int]]:
    """Return (begin, end) of each run of lanes of one road; within a run the ego changes lanes."""
    bounds = [0, *(k for k, (one, other) in enumerate(pairwise(lanes), 1) if one[:2] != other[:2]), len(lanes)]
    return list(pairwise(bounds))


def _along_road(
    network: RoadNetwork, lanes: tuple[LaneKey, ...], span: tuple[float, float], junctions: frozenset[LaneKey]
) -> list[_Piece]:
    """Return the pieces of one road from `span[0]` to `span[1]`: along a lane, or with equally spaced lane changes."""
    if len(lanes) == 1:
        points = sample(network.get_lane(lanes[0]), *span)
        return [_Piece(points, lanes[0], _command(points, lanes[0] in junctions))]
    pieces = []
    each = (span[1] - span[0]) / (len(lanes) - 1)
    for k, (one, other) in enumerate(pairwise(lanes)):
        begin = span[0] + k * each
        middle, end = begin + _CHANGE_SHARE * each, begin + each
        old, new = sample(network.get_lane(one), begin, middle), sample(network.get_lane(other), begin, middle)
        share = np.linspace(0.0, 1.0, len(old))[:, None]
        right = new[0, :2] - old[0, :2]
        side = float(-right[0] * math.sin(old[0, 2]) + right[1] * math.cos(old[0, 2]))
        command = RoadOption.CHANGE_LANE_RIGHT if side > 0.0 else RoadOption.CHANGE_LANE_LEFT
        pieces.append(_Piece(old + (new - old) * share * share * (3.0 - 2.0 * share), one, command))
        pieces.append(_Piece(sample(network.get_lane(other), middle, end), other, RoadOption.LANE_FOLLOW))
    return pieces


def _command(points: Floats, junction: bool) -> RoadOption:
    if not junction:
        return RoadOption.LANE_FOLLOW
    return RoadOption.through_junction(math.remainder(float(points[-1, 2] - points[0, 2]), 2.0 * math.pi))


def _joined(network: RoadNetwork, pieces: list[_Piece]) -> RouteLine:
    stretches = [pieces[0].points]
    for piece in pieces[1:]:  # lanes of highway-env may overlap a little where they meet: never step back
        x, y, yaw = stretches[-1][-1]
        ahead = (piece.points[:, 0] - x) * math.cos(yaw) + (piece.points[:, 1] - y) * math.sin(yaw)
        first = int(np.argmax(ahead > _STEP_M)) if (ahead > _STEP_M).any() else len(piece.points) - 1
        stretches.append(piece.points[first:])
    points = np.concatenate(stretches)
    owner = np.concatenate([np.full(len(stretch), k) for k, stretch in enumerate(stretches)])
    line = resample(points)
    at = arc_lengths(points)
    along = np.linspace(0.0, at[-1], len(line))
    owners = [pieces[int(owner[k])] for k in np.searchsorted(at, along, side="right") - 1]
    limits = [float(network.get_lane(piece.key).speed_limit or DEFAULT_LIMIT_MPS) for piece in owners]
    return RouteLine(
        rows=np.column_stack([line, limits]),
        s=arc_lengths(line),
        keys=tuple(piece.key for piece in owners),
        commands=tuple(piece.command for piece in owners),
    )
