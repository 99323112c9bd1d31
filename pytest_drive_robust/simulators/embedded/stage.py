"""The stage that a scenario definition fills: places on the route, actors, flows, lights, seeded draws."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from pytest_drive_robust.arithmetic import scalars
from pytest_drive_robust.arithmetic.random_numbers import RandomNumbers, Range
from pytest_drive_robust.domain.truth import ActorKind, ActorState
from pytest_drive_robust.simulators.embedded import state as c
from pytest_drive_robust.simulators.embedded.actors import SIZES, ActorSpec, Cast, Script, Trigger
from pytest_drive_robust.simulators.embedded.dense_route import DenseRoute
from pytest_drive_robust.simulators.embedded.light_programs import GREEN, RED, Program
from pytest_drive_robust.simulators.embedded.places import RoutePlaces

CARS = (ActorKind.CAR, ActorKind.VAN, ActorKind.CAR)
"""Kinds of the cars of a flow, in turn."""
_GAPS = 127  # draws of a flow; they repeat after that
_LEAST_ROOM_M = 2.0
"""Least room between consecutive cars of a flow."""


class Stage(RoutePlaces):
    """The world of one episode under construction.

    The ego starts `start_right_m` metres to the right of the route's first point, at `start_mps`. `end_m` is the
    progress at which the scenario is over. `two_ways_near` (x, y, metres, seconds) is the place that the ego has to
    come near, in metres or in seconds at its speed, before it may use the oncoming lane. `ranges` are the ranges of the
    scenario type's elements.
    """

    def __init__(self, dense: DenseRoute, *, seed: int, ranges: Mapping[str, Range]) -> None:
        super().__init__(dense)
        self.ranges = ranges
        self.cast = Cast()
        self.programs: dict[int, Program] = {}
        self.patches: list[tuple[float, float]] = []
        self.emergency_actor = -1
        self.start_right_m = 0.0
        self.start_mps = 0.0
        self.end_m = np.inf
        self.two_ways_near = (0.0, 0.0, 0.0, 0.0)
        self._seed = seed
        self.green_for_ego()

    # --- draws ---

    def draws(self, name: str) -> RandomNumbers:
        """Return a generator that depends on (seed, route, name) and on nothing else."""
        return RandomNumbers.of(self._seed, self.dense.route.id, self.dense.route.town, name)

    def draw(self, name: str, low: float, high: float) -> float:
        """Return one number between `low` and `high`."""
        return self.draws(name).uniform(low, high)

    # --- actors ---

    def stand(
        self,
        kind: ActorKind,
        ahead_m: float,
        right_m: float = 0.0,
        *,
        yaw_rad: float = 0.0,
        state: ActorState = ActorState.NONE,
        appears: bool = False,
    ) -> int:
        """Put a static actor on or beside the ego's path, turned by `yaw_rad` against it; return its number."""
        return self.cast.add(
            ActorSpec(
                kind, self.ego_path, self.on_ego_path(ahead_m), mode=c.MODE_STATIC, right_m=right_m, yaw_rad=yaw_rad,
                state=state, appears=appears,
            )
        )  # fmt: skip

    def dirt(self, ahead_m: float) -> None:
        """Put a patch of dirt on the ego's path; within 2 m of the patch the ego's controls are noisy."""
        self.patches.append(self.spot(ahead_m))
        self.stand(ActorKind.DIRT, ahead_m)

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
        slant_rad: float = 0.0,
    ) -> int:
        """Let a walker cross the ego's path from right to left (with a negative `from_right_m`: left to right).

        The walker walks `walks_m` metres sideways; a positive `slant_rad` slants its way towards the ego.
        """
        to_right_m = from_right_m - float(np.copysign(walks_m, from_right_m))
        lean = scalars.tan(slant_rad) * float(np.sign(from_right_m))
        start = self.spot(ahead_m + lean * from_right_m, from_right_m)
        end = self.spot(ahead_m + lean * to_right_m, to_right_m)
        path = self.add_path(np.array([start, end]))
        actor = self.cast.add(ActorSpec(kind, path, 0.0, mode=c.MODE_WALK, end_m=self.length_m(path)))
        self.cast.script(actor, trigger, Script(speed_mps, delay_s=delay_s), at=self.spot(ahead_m))
        return actor

    def flow(
        self,
        path: int,
        *,
        speed_mps: float,
        gap_m: Range,
        background: bool = False,
        kinds: tuple[ActorKind, ...] = CARS,
        obeys_lights: bool = False,
        sees: int = c.SEES_ALL,
        dense_m: float = 0.0,
    ) -> None:
        """Add a flow of cars (or of `kinds` in turn) along a path.

        Gaps are drawn from `gap_m` and run from middle to middle of consecutive cars, as Bench2Drive measures gaps. Our
        flows never end, so every third gap is twice as long: a patient agent gets through. The first `dense_m` metres
        of the flow, counted back from the path's end, have no such long gap. The other options are those of
        `ActorSpec`.
        """
        name = f"flow{len(self.cast.flow_rows)}"
        least = max(SIZES[kind].length_m for kind in kinds) + _LEAST_ROOM_M
        gaps = self.draws(name).uniforms(max(gap_m[0], least), max(gap_m[1], least + 0.5), _GAPS)
        dense = min(int(np.searchsorted(np.cumsum(gaps), dense_m)), _GAPS // 2)
        gaps[dense + 2 :: 3] *= 2.0
        car = ActorSpec(
            kinds[0], path, 0.0, speed_mps, end_m=self.length_m(path), background=background,
            obeys_lights=obeys_lights, sees=sees,
        )  # fmt: skip
        self.cast.flow(car, kinds=kinds, gaps_m=gaps)

    def borrow_lane(self, ahead_m: float, *, near_m: float, near_s: float = 0.0) -> None:
        """Allow the oncoming lane five seconds after the ego came within `near_m` or `near_s` of a place on its path.

        `near_s` is in seconds at the ego's current speed (Bench2Drive `SwitchWrongDirectionTest` after `Idle(5)`).
        """
        self.two_ways_near = (*self.spot(ahead_m), near_m, near_s)

    # --- lights ---

    def lights(self, *, ego: Program, opposite: Program, crossing: Program = RED) -> None:
        """Set the programs at the first junction: the ego's light, the opposite light, the crossing road's lights."""
        self.first_passage()  # raises a clear error without a junction
        self._set_lights(0, ego, opposite, crossing)

    def green_for_ego(self) -> None:
        """Show green along the ego's road and red across at every junction with lights. The default."""
        for number in range(len(self.dense.passages())):
            self._set_lights(number, GREEN, GREEN, RED)

    def _set_lights(self, number: int, ego: Program, opposite: Program, crossing: Program) -> None:
        own = self.dense.passages()[number].heading_rad
        for index in self.dense.junction_stops(number):
            towards = scalars.cos(self.dense.lane_map.stop_lines[index].heading_rad - own)
            self.programs[index] = ego if towards > 0.7 else opposite if towards < -0.7 else crossing
