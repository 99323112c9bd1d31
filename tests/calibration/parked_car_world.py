"""A world where late commands cost something: a car is parked somewhere ahead, and who passes it fast hits it.

Where it stands is drawn by route and seed, so two drives of one route differ as they do in real simulators.
"""

from __future__ import annotations

import random
from collections import deque
from collections.abc import Sequence
from dataclasses import replace

from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.observation import CameraSpec, Observation
from pytest_drive_robust.domain.outcome import End, Infraction, InfractionKind
from pytest_drive_robust.domain.route import GlobalPlan, Route
from pytest_drive_robust.domain.truth import WorldState
from pytest_drive_robust.options.run import RunOptions
from pytest_drive_robust.perturbations.base import Setting
from pytest_drive_robust.report.run_result import RunResult
from pytest_drive_robust.runner.episode.loop import drive_episode
from pytest_drive_robust.runner.plan import EpisodeRequest
from pytest_drive_robust.simulators.base import EpisodeScore, SimulatorOptions
from pytest_drive_robust.store.events import EpisodesNeeded, Used
from pytest_drive_robust.testing import FakeSimulator, fake_route

SLOW_ENOUGH_MPS = 3.0
BRAKES_FROM_M = 4.6
SETTINGS = ("clean", "200 ms latency")


class ParkedCarWorld(FakeSimulator):
    """Passing the parked car faster than 3 m/s is a collision that ends the drive.

    A camera pixel shows the distance to it in quarter metres.
    """

    def reset(self, route: Route, *, seed: int, cameras: Sequence[CameraSpec]) -> WorldState:
        state = super().reset(route, seed=seed, cameras=cameras)
        self._parked_m = random.Random(f"parked {route.id} {seed}").uniform(12.0, 15.0)
        self._actors[0, WorldState.X] = self._parked_m
        self._passed_mps = 0.0
        return state

    def step(self, control: Control) -> WorldState:
        before_m = self._ego.x_m
        state = super().step(control)
        if before_m < self._parked_m <= self._ego.x_m:
            self._passed_mps = self._ego.speed_mps
        return state

    @property
    def done(self) -> End | None:
        return End.BLOCKED if self._hit else super().done

    def score(self) -> EpisodeScore:
        score = super().score()
        if not self._hit:
            return score
        hit = Infraction(InfractionKind.COLLISION_VEHICLE, self._tick, f"hit a car at {self._passed_mps:.1f} m/s")
        return replace(score, infractions=(hit,))

    @property
    def _hit(self) -> bool:
        return self._passed_mps > SLOW_ENOUGH_MPS


class Braker:
    """Full throttle, but slow past the car that its camera sees. `late_ticks` is how long its commands lie around."""

    def __init__(self, *, late_ticks: int = 0) -> None:
        self._late_ticks = late_ticks

    def sensors(self) -> list[CameraSpec]:
        return [CameraSpec("front", width_px=1, height_px=1)]

    def reset(self, route: GlobalPlan, seed: int) -> None:
        self._last_m = 1000.0
        self._queue: deque[Control] = deque([Control()] * self._late_ticks)

    def act(self, observation: Observation) -> Control:
        self._queue.append(self._wanted(observation))
        return self._queue.popleft()

    def _wanted(self, observation: Observation) -> Control:
        distance_m = float(observation.cameras["front"].pixels[0, 0, 1]) / 4.0
        passed, self._last_m = distance_m > self._last_m, distance_m
        if passed or distance_m > BRAKES_FROM_M:
            return Control(throttle=1.0)
        return Control(brake=1.0) if observation.speed.mps > 2.0 else Control(throttle=0.5)


def drive_run(agent: Braker, *, routes: int, seed: int) -> RunResult:
    """Every route under every setting, as a run with one seed."""
    world = ParkedCarWorld(SimulatorOptions(tick_cap=400))
    episodes, events = {}, []
    for sentence in SETTINGS:
        setting, keys = Setting.parse(sentence), []
        for number in range(routes):
            route = fake_route(str(number), length_m=17.0)
            result = drive_episode(world, agent, route=route, setting=setting, seed=seed, agent_name="braker")
            keys.append(EpisodeRequest(result.episode, route, setting).key)
            episodes[keys[-1]] = result
        events += [EpisodesNeeded("braker", "routes.xml", sentence, (seed,), tuple(keys)), Used(tuple(keys))]
    return RunResult.of(RunOptions(simulator="fake"), events, episodes.get, versions={})
