"""What a scenario definition works with: places on the route, actors, flows, lights, seeded draws."""

from __future__ import annotations

import hashlib

import numpy as np
from numpy.typing import NDArray

from pytest_drive_robust.domain.route import ScenarioSpec
from pytest_drive_robust.domain.truth import ActorKind, Lane, LaneKind
from pytest_drive_robust.errors import RouteError
from pytest_drive_robust.simulators.embedded import state as c
from pytest_drive_robust.simulators.embedded.actors import SIZES_M, Cast, Script
from pytest_drive_robust.simulators.embedded.dense_route import DenseRoute
from pytest_drive_robust.simulators.embedded.geometry import arc_lengths, place, project, resample
from pytest_drive_robust.simulators.embedded.map import follow, join
from pytest_drive_robust.simulators.embedded.signals import GREEN, RED, Program
from pytest_drive_robust.simulators.embedded.triggers import Passing, Trigger

__all__ = ["Stage"]

Floats = NDArray[np.float64]


class Stage:
    """The world of one episode under construction.

    Distances `ahead_m` are metres along the route after the scenario's trigger point; `right_m` is metres to the
    right of the centre of the ego's lane.
    """

    def __init__(self, dense: DenseRoute, *, seed: int) -> None:
        self.dense = dense
        self.spec: ScenarioSpec = dense.route.scenario
        self.cast = Cast()
        self.paths: list[Floats] = []
        self.programs: dict[int, Program] = {}
        self.emergency_actor = -1
        self.end_m = np.inf
        self._seed = seed
        line, self._start_m = dense.driven_line()
        self.ego_path = self.add_path(line)

    # --- draws ---

    def draws(self, name: str) -> np.random.Generator:
        """A generator that depends on (seed, route, name) and on nothing else."""
        text = f"{self._seed}\x1f{self.dense.route.id}\x1f{self.dense.route.town}\x1f{name}".encode()
        key = np.frombuffer(hashlib.blake2b(text, digest_size=16).digest(), dtype=np.uint64)
        return np.random.Generator(np.random.Philox(key=key))

    def draw(self, name: str, low: float, high: float) -> float:
        """One number between `low` and `high`."""
        return float(self.draws(name).uniform(low, high))

    # --- places ---

    @property
    def trigger_m(self) -> float:
        """Where the scenario wakes up, in metres of the route."""
        return self.dense.trigger_m

    @property
    def lane_width_m(self) -> float:
        """Width of the ego's lane at the trigger."""
        return self._lane_at(0.0).width_m

    @property
    def speed_limit_mps(self) -> float:
        """Speed limit of the ego's lane at the trigger."""
        return self._lane_at(0.0).speed_limit_mps

    def add_path(self, line: Floats) -> int:
        """Make a line drivable for actors; its number."""
        self.paths.append(resample(line))
        return len(self.paths) - 1

    def on_ego_path(self, ahead_m: float) -> float:
        """Distance along the ego's lane (`ego_path`), which begins long before the route does."""
        return self._start_m + self.trigger_m + ahead_m

    def spot(self, ahead_m: float, right_m: float = 0.0) -> tuple[float, float]:
        """x, y of a place on or beside the ego's lane."""
        return place(self.paths[self.ego_path], self.on_ego_path(ahead_m), right_m)[:2]

    def junction_ahead_m(self) -> float:
        """Distance from the trigger to where the route enters its first junction. Raises `RouteError` without one."""
        row = self.dense.first_junction_row()
        if row is None:
            raise RouteError(f"route {self.dense.route.id}: scenario {self.spec.type} needs a junction on its route")
        return float(self.dense.s[row]) - self.trigger_m

    def beside(self, side: str) -> int:
        """The path of the driving lane to the `"left"` or `"right"` of the ego's lane, in its own direction."""
        lane = self._lane_at(0.0)
        index = lane.left if side == "left" else lane.right
        if index < 0 or self.dense.lane_map.lanes[index].kind is not LaneKind.DRIVING:
            raise RouteError(
                f"route {self.dense.route.id}: scenario {self.spec.type} needs a driving lane to the {side} of it"
            )
        return self.add_path(join(self.dense.lane_map, follow(self.dense.lane_map, index)))

    def oncoming(self) -> int:
        """The path of the nearest lane that leads the other way."""
        lanes = self.dense.lane_map.lanes
        index, same_way = self._lane_at(0.0).left, self._lane_at(0.0).left_same_way
        while index >= 0 and same_way:
            index, same_way = lanes[index].left, lanes[index].left_same_way
        if index < 0:
            raise RouteError(f"route {self.dense.route.id}: scenario {self.spec.type} needs an oncoming lane")
        return self.add_path(join(self.dense.lane_map, follow(self.dense.lane_map, index)))

    def from_arm(self, bearing: str) -> int:
        """The path straight over the junction that comes from the `"left"`, `"right"` or `"opposite"` of the ego."""
        lanes = self.dense.lane_map.lanes
        row = self.dense.first_junction_row()
        if row is None:
            raise RouteError(f"route {self.dense.route.id}: scenario {self.spec.type} needs a junction on its route")
        heading = lanes[self.dense.lanes[row]].centre[0, 2]
        wanted = heading + {"left": np.pi / 2, "right": -np.pi / 2, "opposite": np.pi}[bearing]
        for lane in lanes:
            straight = lane.junction and np.cos(lane.centre[-1, 2] - lane.centre[0, 2]) > 0.99
            # of several lanes the outermost comes first in the turn lanes' way: the last one found
            if straight and np.cos(lane.centre[0, 2] - wanted) > 0.99:
                return self.add_path(join(self.dense.lane_map, follow(self.dense.lane_map, lane.index)))
        raise RouteError(f"route {self.dense.route.id}: no road from the {bearing} for scenario {self.spec.type}")

    def length_m(self, path: int) -> float:
        """Length of a path."""
        return float(arc_lengths(self.paths[path])[-1])

    def along(self, path: int, ahead_m: float) -> float:
        """Where on a path an actor is level with a place of the ego's lane."""
        return project(self.paths[path], *self.spot(ahead_m))[0]

    def _lane_at(self, ahead_m: float) -> Lane:
        s = self.trigger_m + ahead_m
        row = int(np.clip(np.searchsorted(self.dense.s, s), 0, len(self.dense.s) - 1))
        return self.dense.lane_map.lanes[int(self.dense.lanes[row])]

    # --- actors ---

    def stand(self, kind: ActorKind, ahead_m: float, right_m: float = 0.0) -> int:
        """Something that does not move, beside or on the ego's lane."""
        return self.cast.add(
            kind, mode=c.MODE_STATIC, path=self.ego_path, s_m=self.on_ego_path(ahead_m), right_m=right_m
        )

    def walker(
        self,
        ahead_m: float,
        *,
        from_right_m: float,
        walks_m: float,
        speed_mps: float,
        trigger: Trigger,
        delay_s: float = 0.0,
        kind: ActorKind = ActorKind.PEDESTRIAN,
    ) -> int:
        """Somebody who crosses the ego's lane from right to left (from a negative `from_right_m`: left to right)."""
        sign = -1.0 if from_right_m > 0.0 else 1.0
        start, end = self.spot(ahead_m, from_right_m), self.spot(ahead_m, from_right_m + sign * walks_m)
        path = self.add_path(np.array([start, end]))
        actor = self.cast.add(kind, mode=c.MODE_WALK, path=path, s_m=0.0, end_m=walks_m)
        self.cast.script(actor, trigger, Script(speed_mps, delay_s=delay_s), at=self.spot(ahead_m))
        return actor

    def drive(self, kind: ActorKind, path: int, s_m: float, speed_mps: float, **options: object) -> int:
        """A car that follows a path with the driver model."""
        return self.cast.add(
            kind,
            mode=c.MODE_DRIVE,
            path=path,
            s_m=s_m,
            speed_mps=speed_mps,
            **options,  # type: ignore[arg-type]
        )

    def flow(
        self,
        path: int,
        *,
        speed_mps: float,
        gap_m: tuple[float, float],
        source_m: float = 0.0,
        sink_m: float | None = None,
        background: bool = False,
    ) -> None:
        """Cars one after the other along a path, gaps drawn from `gap_m` (front of one car to rear of the next).

        Our flows never end, so every third gap is twice as long: somebody who waits patiently gets through.
        """
        name = f"flow{len(self.cast.flow_rows)}"
        sink = self.length_m(path) if sink_m is None else sink_m
        gaps = self.draws(name).uniform(max(gap_m[0], 4.0), max(gap_m[1], 4.5), size=63)
        gaps[2::3] *= 2.0
        gaps += SIZES_M[ActorKind.VAN][0]
        self.cast.flow(path, source_m=source_m, sink_m=sink, speed_mps=speed_mps, gaps_m=gaps, background=background)

    def passing(self, ahead_m: float) -> Trigger:
        """The ego passes a place of the route."""
        return Passing(self.trigger_m + ahead_m)

    def ride(self, speed_mps: float, right_m: float) -> Script:
        """Set off at a speed and keep to the same side."""
        return Script(speed_mps, right_m=right_m)

    # --- lights ---

    def lights(self, *, ego: Program, opposite: Program, crossing: Program = RED) -> None:
        """Programs for the ego's light, the opposite one, and those of the crossing road."""
        lanes = self.dense.lane_map.lanes
        row = self.dense.first_junction_row()
        if row is None:
            raise RouteError(f"route {self.dense.route.id}: scenario {self.spec.type} needs a junction on its route")
        heading = lanes[self.dense.lanes[row]].centre[0, 2]
        for line in self.dense.lane_map.stop_lines:
            towards = np.cos(line.heading_rad - heading)
            self.programs[line.index] = ego if towards > 0.7 else opposite if towards < -0.7 else crossing

    def green_for_ego(self) -> None:
        """Where the junction has lights: green along the ego's road, red across."""
        if any(line.is_light for line in self.dense.lane_map.stop_lines):
            self.lights(ego=GREEN, opposite=GREEN)
