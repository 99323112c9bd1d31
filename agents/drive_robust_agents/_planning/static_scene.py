"""The expert's knowledge of a route before the start: lanes under the route, junctions, stop lines, lane changes."""

from __future__ import annotations

import copy
from dataclasses import dataclass

import numpy as np

from drive_robust_agents._planning.control import speed_profile
from drive_robust_agents._planning.tracks import lane_under
from pytest_drive_robust.arithmetic import scalars
from pytest_drive_robust.arithmetic.arrays import cos, sin
from pytest_drive_robust.domain.truth import GroundTruth, Lane, LaneKind, LaneMap
from pytest_drive_robust.jit.arrays import Floats, Ints

__all__ = ["Change", "LaneGraph", "StaticScene"]

_LATERAL_MPS2, _BRAKE_MPS2 = 2.8, 1.8
_BESIDE_M = 5.5
"""A lane whose centre is farther from the route than this is not beside it."""
_ABREAST_M = 0.9
"""Two lanes run side by side where their centres are a lane's width apart, within this much."""
_BEYOND_M = 60


class LaneGraph:
    """All lanes for vehicles, as arrays for the kernels; see `tracks.tracks`.

    `after` is the lane that traffic is expected to take behind each lane: the straightest successor, until an actor was
    seen on another (`tracks` updates the array).
    """

    def __init__(self, lane_map: LaneMap) -> None:
        self.lanes = lane_map.lanes
        used = [lane.kind in (LaneKind.DRIVING, LaneKind.BIKING) for lane in self.lanes]
        sizes = [len(lane.centre) if keep else 0 for lane, keep in zip(self.lanes, used, strict=True)]
        centres = np.concatenate([lane.centre for lane, keep in zip(self.lanes, used, strict=True) if keep])
        self.first: Ints = np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64)
        self.points: Floats = np.column_stack([centres, cos(centres[:, 2]), sin(centres[:, 2])])
        self.owner: Ints = np.repeat(np.arange(len(self.lanes), dtype=np.int64), sizes)
        self.after: Ints = np.array([_straightest(self.lanes, lane) for lane in self.lanes], dtype=np.int64)
        self._before: dict[int, list[int]] = {}
        for lane in self.lanes:
            for k in lane.successors:
                self._before.setdefault(k, []).append(lane.index)
        feeders = [self._before.get(lane.index, []) if lane.junction else [] for lane in self.lanes]
        self.entries: Ints = np.cumsum([0, *map(len, feeders)], dtype=np.int64)
        self.feeders: Ints = np.array([k for several in feeders for k in several], dtype=np.int64)

    def fork(self) -> LaneGraph:
        """Return a graph of these lanes with its own copy of `after`."""
        other = copy.copy(self)
        other.after = self.after.copy()
        return other

    def before(self, lane: int) -> int:
        """Return the lane that leads straightest into this one, or -1."""
        options = self._before.get(lane, [])
        plain = [k for k in options if not self.lanes[k].junction]
        return (plain or options or [-1])[0]


@dataclass(frozen=True, slots=True)
class Change:
    """A lane change that the route asks for.

    Between the rows `first` and `last` both lanes run side by side. `old` and `new` (n,) are metres from the route to
    the centre of the old lane and of the new lane, at each row of the route. The route itself begins to change lanes at
    row `start`.
    """

    first: int
    last: int
    start: int
    old: Floats
    new: Floats


class StaticScene:
    """The static side of one episode. Rows are rows of `GroundTruth.route`, about a metre each.

    `route` (n, 4) continues straight beyond its end (`given` rows), so that plans have room. `limits` (n,) is the
    highest sensible speed, `lanes` (n,) the lane below, `junctions` (m, 2) the first and last row of each junction,
    `stops` the (number, row) of each stop line, `changes` the lane changes.
    """

    def __init__(self, truth: GroundTruth) -> None:
        self.given = len(truth.route)
        self.route = _prolonged(truth.route)
        self.count = len(self.route)
        self.rows: Floats = np.arange(self.count, dtype=np.float64)
        self.sines: Floats = sin(self.route[:, 2])
        self.cosines: Floats = cos(self.route[:, 2])
        self.lane_map = truth.lane_map
        self.graph = LaneGraph(truth.lane_map)
        self.limits = speed_profile(self.route, lateral_mps2=_LATERAL_MPS2, brake_mps2=_BRAKE_MPS2)
        self.size = np.array([truth.state.ego.length_m, truth.state.ego.width_m])
        self.half_length_m, self.half_width_m = truth.state.ego.length_m / 2.0, truth.state.ego.width_m / 2.0
        self.lanes = self._lanes_under()
        self.junctions = self._junctions()
        self.stops = self._stops()
        self.changes = self._changes()

    def fork(self) -> StaticScene:
        """Return a copy of the scene whose `graph` learns about traffic separately."""
        other = copy.copy(self)
        other.graph = self.graph.fork()
        return other

    def index(self, row: float) -> int:
        """Return the number of a row as an index of `route`."""
        return int(min(max(row, 0.0), self.count - 1.0))

    def lane_at(self, row: float) -> Lane:
        """Return the lane under a row."""
        return self.lane_map.lanes[int(self.lanes[self.index(row)])]

    def neighbour(self, row: float, side: str) -> tuple[Lane | None, bool]:
        """Return (driving lane on `side` of the lane under a row, or None; whether it leads the same way)."""
        index, same_way = self.lane_at(row).beside(side)
        if index < 0 or self.lane_map.lanes[index].kind is not LaneKind.DRIVING:
            return None, False
        return self.lane_map.lanes[index], same_way

    def _lanes_under(self) -> Ints:
        graph, found = self.graph, np.empty(self.count, dtype=np.int64)
        driving = np.array([lane.kind is LaneKind.DRIVING for lane in self.lane_map.lanes])
        keep = driving[graph.owner]
        points, owner = np.ascontiguousarray(graph.points[keep]), np.ascontiguousarray(graph.owner[keep])
        last = int(owner[0])
        for k in range(self.count):
            x, y = self.route[k, :2]
            row, _ = lane_under(points, x, y, self.cosines[k], self.sines[k], 4.0)
            last = int(owner[row]) if row >= 0 else last
            found[k] = last
        return _longest_connector(self.lane_map, found)

    def _junctions(self) -> Floats:
        """Return (m, 2): first and last row of every junction on the route."""
        inside = np.array([self.lane_map.lanes[k].junction for k in self.lanes])
        edges = np.flatnonzero(np.diff(np.concatenate([[0], inside.astype(int), [0]])))
        junctions: Floats = edges.reshape(-1, 2).astype(float) - np.array([0.0, 1.0])
        return junctions

    def _stops(self) -> tuple[tuple[int, float], ...]:
        """Return (number, row) of every stop line on the route."""
        found = []
        for line in self.lane_map.stop_lines:
            dx, dy = self.route[:, 0] - line.x_m, self.route[:, 1] - line.y_m
            away = dx * dx + dy * dy
            k = int(np.argmin(away))
            if away[k] < 1.5 * 1.5 and scalars.cos(self.route[k, 2] - line.heading_rad) > 0.7:
                found.append((line.index, float(k)))
        return tuple(found)

    def _changes(self) -> tuple[Change, ...]:
        found = []
        for k in range(1, self.given):  # beyond its end the straight continuation may cross lanes
            here, there = self.lane_map.lanes[self.lanes[k - 1]], self.lane_map.lanes[self.lanes[k]]
            beside = there.index in (here.left, here.right) or here.index in (there.left, there.right)
            if here.index != there.index and there.index not in here.successors and beside:
                found.append(self._change(k, here.index, there.index))
        return tuple(found)

    def _change(self, k: int, old: int, new: int) -> Change:
        offsets = [self._offsets(k, lane) for lane in (old, new)]
        apart = np.abs(np.abs(offsets[0] - offsets[1]) - self.lane_map.lanes[old].width_m)
        both = np.nan_to_num(apart, nan=np.inf) < _ABREAST_M
        first, last = k, k
        while first > 0 and both[first - 1]:
            first -= 1
        while last < self.count - 1 and both[last + 1]:
            last += 1
        start = k
        while start > first and abs(offsets[0][start]) > 0.15:
            start -= 1
        return Change(first, last, start, np.nan_to_num(offsets[0]), np.nan_to_num(offsets[1]))

    def _offsets(self, k: int, lane: int) -> Floats:
        """Return metres to the right of the route of the centre line through `lane`; NaN where it is not beside."""
        chain, graph = [lane], self.graph
        while (earlier := graph.before(chain[0])) >= 0 and earlier not in chain and len(chain) < 8:
            chain.insert(0, earlier)
        while (later := _straightest(graph.lanes, graph.lanes[chain[-1]])) >= 0 and later not in chain:
            chain.append(later)
        line = np.concatenate([graph.lanes[index].centre for index in chain])
        low, high = max(0, k - 220), min(self.count, k + 220)
        dx = line[:, 0] - self.route[low:high, None, 0]
        dy = line[:, 1] - self.route[low:high, None, 1]
        nearest = np.argmin(dx * dx + dy * dy, axis=1)
        rows = np.arange(high - low)
        dx, dy, c, s = dx[rows, nearest], dy[rows, nearest], self.cosines[low:high], self.sines[low:high]
        ahead, right = dx * c + dy * s, dy * c - dx * s
        aligned = cos(line[nearest, 2] - self.route[low:high, 2]) > 0.8
        found = np.full(self.count, np.nan)
        found[low:high] = np.where((np.abs(ahead) < 1.2) & (np.abs(right) < _BESIDE_M) & aligned, right, np.nan)
        return found


def _prolonged(route: Floats) -> Floats:
    """Return the route with a straight piece added at its end."""
    x, y, yaw, limit = route[-1]
    ahead = np.arange(1.0, _BEYOND_M + 1.0)
    more = [
        x + ahead * scalars.cos(yaw),
        y + ahead * scalars.sin(yaw),
        np.full(len(ahead), yaw),
        np.full(len(ahead), limit),
    ]
    return np.ascontiguousarray(np.concatenate([route, np.column_stack(more)]))


def _straightest(lanes: tuple[Lane, ...], lane: Lane) -> int:
    """Return the successor that turns least, or -1."""
    options = lane.successors
    if not options:
        return -1
    return min(options, key=lambda k: abs(float(lanes[k].centre[-1, 2] - lanes[k].centre[0, 2])))


def _longest_connector(lane_map: LaneMap, found: Ints) -> Ints:
    """Replace junction lanes that alternate, because they share their first metres, by the lane of later rows."""
    cleaned: Ints = found.copy()
    for k in range(len(found) - 2, -1, -1):
        here, there = lane_map.lanes[cleaned[k]], lane_map.lanes[cleaned[k + 1]]
        if here.junction and there.junction and here.index != there.index and there.index not in here.successors:
            cleaned[k] = there.index
    return cleaned
