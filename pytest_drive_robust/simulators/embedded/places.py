"""Places for a scenario: along the route, on lanes as paths of actors, at the junction."""

from __future__ import annotations

import numpy as np

from pytest_drive_robust.arithmetic import scalars
from pytest_drive_robust.domain.route import ScenarioSpec
from pytest_drive_robust.domain.truth import Lane, LaneKind
from pytest_drive_robust.errors import RouteError
from pytest_drive_robust.jit.arrays import Floats
from pytest_drive_robust.simulators.embedded.dense_route import DenseRoute
from pytest_drive_robust.simulators.embedded.geometry import arc_lengths, place, project, resample
from pytest_drive_robust.simulators.embedded.map import Passage, join, leftmost, prolonged_chain
from pytest_drive_robust.simulators.embedded.matching import nearest_way

_BEARINGS_RAD = {"left": np.pi / 2.0, "right": -np.pi / 2.0, "opposite": np.pi}
"""Heading of traffic from each arm, relative to the ego's own way into the junction."""
_STRAIGHT_RAD = 0.35


class RoutePlaces:
    """A route on its town as scenario definitions see it.

    Distances `ahead_m` are metres along the route after the scenario's trigger point; `right_m` is metres to the
    right of the route. A *path* is the number of a line that actors can follow.
    """

    def __init__(self, dense: DenseRoute) -> None:
        self.dense = dense
        self.spec: ScenarioSpec = dense.route.scenario
        self.paths: list[Floats] = []
        line, self._start_m = dense.driven_line()
        self.ego_path = self.add_path(line)

    @property
    def trigger_m(self) -> float:
        """The scenario's start, in metres of the route."""
        return self.dense.trigger_m

    @property
    def lane_width_m(self) -> float:
        """Width of the ego's lane at the trigger."""
        return self.lane_at(0.0).width_m

    @property
    def speed_limit_mps(self) -> float:
        """Speed limit of the ego's lane at the trigger."""
        return self.lane_at(0.0).speed_limit_mps

    def lane_at(self, ahead_m: float) -> Lane:
        """Return the lane under the route."""
        s = self.trigger_m + ahead_m
        row = int(np.clip(np.searchsorted(self.dense.s, s), 0, len(self.dense.s) - 1))
        return self.dense.lane_map.lanes[int(self.dense.lanes[row])]

    # --- along the route ---

    def on_ego_path(self, ahead_m: float) -> float:
        """Return the distance along the ego's way (`ego_path`), which begins long before the route does."""
        return self._start_m + self.trigger_m + ahead_m

    def spot(self, ahead_m: float, right_m: float = 0.0) -> tuple[float, float]:
        """Return x, y of a place on the ego's path, or `right_m` beside it."""
        return place(self.paths[self.ego_path], self.on_ego_path(ahead_m), right_m)[:2]

    def junction_ahead_m(self) -> float:
        """Return the metres from the trigger to the route's first junction. Raises `RouteError` without one."""
        return float(self.dense.s[self._junction_rows()[0]]) - self.trigger_m

    def exit_ahead_m(self) -> float:
        """Return the metres from the trigger to behind the first junction. Raises `RouteError` without one."""
        return float(self.dense.s[self._junction_rows()[1]]) - self.trigger_m

    def _junction_rows(self) -> tuple[int, int]:
        """Return (first row in, first row behind) of the route's first junction."""
        first = self.dense.first_junction_row()
        if first is None:
            raise self._needs("a junction on its route")
        inside = [self.dense.lane_map.lanes[k].junction for k in self.dense.lanes[first:]]
        return first, first + (inside.index(False) if False in inside else len(inside) - 1)

    def _needs(self, what: str) -> RouteError:
        return RouteError(f"route {self.dense.route.id}: scenario {self.spec.type} needs {what}")

    # --- paths ---

    def add_path(self, line: Floats) -> int:
        """Add a line that actors can follow; return the number of the path."""
        self.paths.append(resample(line))
        return len(self.paths) - 1

    def length_m(self, path: int) -> float:
        """Return the length of a path."""
        return float(arc_lengths(self.paths[path])[-1])

    def along(self, path: int, ahead_m: float) -> float:
        """Return where on a path an actor is level with a place of the ego's way."""
        return project(self.paths[path], *self.spot(ahead_m))[0]

    def own(self, ahead_m: float = 0.0) -> int:
        """Return the path of the lane under the route, followed straight on to both ends of the town."""
        return self._path((self.lane_at(ahead_m).index,))

    def beside(self, side: str, ahead_m: float = 0.0) -> int:
        """Return the path of the driving lane `"left"` or `"right"` of the route's lane, in its own direction."""
        index, _ = self.lane_at(ahead_m).beside(side)
        if not self._is_driven(index):
            raise self._needs(f"a driving lane to the {side} of it")
        return self._path((index,))

    def has_lane_beside(self, side: str, ahead_m: float = 0.0) -> bool:
        """Return whether there is a driving lane to the `"left"` or `"right"` that leads the same way."""
        index, same_way = self.lane_at(ahead_m).beside(side)
        return same_way and self._is_driven(index)

    def oncoming(self, ahead_m: float = 0.0) -> int:
        """Return the path of the nearest lane that leads the other way. Raises `RouteError` where there is none."""
        lane_map = self.dense.lane_map
        other = lane_map.lanes[leftmost(lane_map, self.lane_at(ahead_m).index)].left
        if not self._is_driven(other):
            raise self._needs("an oncoming lane")
        return self._path((other,))

    def _is_driven(self, index: int) -> bool:
        return index >= 0 and self.dense.lane_map.lanes[index].kind is LaneKind.DRIVING

    def from_arm(self, bearing: str, *, into: str = "straight") -> int:
        """Return a path through the route's first junction that comes from the `"left"`, `"right"` or `"opposite"`.

        `into="straight"` goes straight on, `into="exit"` turns into the lane by which the route leaves the junction.
        Raises `RouteError` when the junction has no such way.
        """
        own = self.first_passage()
        heading = own.heading_rad + _BEARINGS_RAD[bearing]
        for way in self.dense.town.passages:
            fits = abs(way.turn_rad) < _STRAIGHT_RAD if into == "straight" else way.leaves == own.leaves
            if fits and way.junction == own.junction and scalars.cos(way.heading_rad - heading) >= 0.7:
                return self._path((way.enters, *way.inside, way.leaves))
        raise self._needs(f"a way from the {bearing} to {into!r}")

    def given_flow(self) -> int | None:
        """Return the path nearest to the route file's `start_actor_flow`, then `end_actor_flow`; None without these."""
        ends = [self.spec.parameters.get(f"{end}_actor_flow", {}) for end in ("start", "end")]
        if any("x" not in end or "y" not in end for end in ends):
            return None
        return self._path(nearest_way(self.dense.lane_map, *((end["x"], end["y"]) for end in ends)))

    def first_passage(self) -> Passage:
        """Return the route's way through its first junction. Raises `RouteError` without one."""
        way = self.dense.first_passage()
        if way is None:
            raise self._needs("a junction on its route")
        return way

    def _path(self, chain: tuple[int, ...]) -> int:
        return self.add_path(join(self.dense.lane_map, prolonged_chain(self.dense.lane_map, chain)))
