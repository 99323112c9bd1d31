"""The simulator: moved egos, worlds that take turns, and the same bits in any order and process."""

from __future__ import annotations

import hashlib
import math
import os
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from lockstep_agents import drive_together

from drive_robust_agents.classical import Classical
from pytest_drive_robust import CameraSpec, GlobalPlan
from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.episode import Episode
from pytest_drive_robust.domain.observation import Observation
from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.errors import SimulationError
from pytest_drive_robust.perturbations import Setting
from pytest_drive_robust.runner.episode.loop import drive_episode
from pytest_drive_robust.runner.plan import EpisodeRequest
from pytest_drive_robust.simulators.base import SimulatorOptions
from pytest_drive_robust.simulators.embedded import EmbeddedSimulator
from pytest_drive_robust.simulators.embedded.route_sets import named_routes
from pytest_drive_robust.store.record import encode_episode


@pytest.fixture
def simulator() -> EmbeddedSimulator:
    """Under way for three seconds, with the wheels turned a little."""
    made = EmbeddedSimulator()
    made.reset(named_routes("one-per-scenario")[3], seed=0, cameras=())
    for _ in range(60):
        made.step(Control(0.6, 0.05, 0.0))
    return made


def test_the_ego_is_put_there_and_nobody_else_moves(simulator: EmbeddedSimulator) -> None:
    before = simulator.state
    state = simulator.place_ego(x_m=3.0, y_m=-4.0, yaw_rad=7.0, speed_mps=5.0)
    assert (state.ego.x_m, state.ego.y_m, state.ego.speed_mps) == (3.0, -4.0, 5.0)
    assert state.ego.yaw_rad == pytest.approx(7.0 - math.tau)
    assert state.tick == before.tick
    assert np.array_equal(state.actors, before.actors)
    assert simulator.state is state
    assert simulator.observe().gps.x_m == 3.0


def test_the_imu_tells_what_follows_from_speed_and_wheels(simulator: EmbeddedSimulator) -> None:
    simulator.step(Control(0.0, 0.05, 0.0))
    ego = simulator.state.ego
    same = simulator.place_ego(x_m=ego.x_m, y_m=ego.y_m, yaw_rad=ego.yaw_rad, speed_mps=ego.speed_mps).ego
    assert same.yaw_rate_radps == pytest.approx(ego.yaw_rate_radps, rel=0.02)
    assert same.right_mps2 == pytest.approx(ego.right_mps2, rel=0.03)
    assert same.forward_mps2 == ego.forward_mps2
    half = simulator.place_ego(x_m=ego.x_m, y_m=ego.y_m, yaw_rad=ego.yaw_rad, speed_mps=0.5 * ego.speed_mps).ego
    assert half.yaw_rate_radps == pytest.approx(0.5 * same.yaw_rate_radps)
    assert half.right_mps2 == pytest.approx(0.25 * same.right_mps2)


def test_an_ego_without_speed_is_at_rest(simulator: EmbeddedSimulator) -> None:
    ego = simulator.state.ego
    still = simulator.place_ego(x_m=ego.x_m, y_m=ego.y_m, yaw_rad=ego.yaw_rad, speed_mps=0.0).ego
    assert (still.speed_mps, still.forward_mps2, still.right_mps2, still.yaw_rate_radps) == (0.0, 0.0, 0.0, 0.0)
    assert simulator.step(Control.NEUTRAL).ego.speed_mps == 0.0


def test_an_ego_at_speed_does_not_turn_faster_than_its_grip_allows(simulator: EmbeddedSimulator) -> None:
    for _ in range(40):
        simulator.step(Control(0.0, 1.0, 0.3))
    ego = simulator.state.ego
    fast = simulator.place_ego(x_m=ego.x_m, y_m=ego.y_m, yaw_rad=ego.yaw_rad, speed_mps=20.0).ego
    assert 9.0 < abs(fast.right_mps2) < 10.0


def test_a_restored_moment_is_as_if_nothing_had_been(simulator: EmbeddedSimulator) -> None:
    kept, before = simulator.snapshot(), simulator.state
    simulator.place_ego(x_m=0.0, y_m=0.0, yaw_rad=0.0, speed_mps=9.0)
    simulator.step(Control(1.0, 0.0, 0.0))
    simulator.restore(kept)
    assert simulator.state.ego == before.ego
    assert simulator.state.tick == before.tick


@pytest.mark.parametrize("speed_mps", [-1.0, math.nan, math.inf])
def test_what_no_ego_can_have_is_refused(simulator: EmbeddedSimulator, speed_mps: float) -> None:
    with pytest.raises(SimulationError, match="expected finite numbers and a speed of 0 or more"):
        simulator.place_ego(x_m=0.0, y_m=0.0, yaw_rad=0.0, speed_mps=speed_mps)


class Many(Classical):
    """Its `act` for each: what differs from driving one by one can only come from the worlds."""

    @staticmethod
    def act_batch(agents: Sequence[Many], observations: Sequence[Observation]) -> list[Control]:
        return [agent.act(observation) for agent, observation in zip(agents, observations, strict=True)]


def world() -> EmbeddedSimulator:
    return EmbeddedSimulator(SimulatorOptions(tick_cap=70))


def bits(result: EpisodeResult) -> bytes:
    return encode_episode(replace(result, wall_s=0.0, versions={}))


def test_the_embedded_worlds_of_a_lockstep_do_not_disturb_each_other() -> None:
    settings = [Setting.parse(text) for text in ("clean", "occlusion 0.5", "GPS noise 5 m and 200 ms latency")]
    routes = named_routes("one-per-scenario")[::8]
    tasks = [
        EpisodeRequest(Episode("many", route.id, str(settings[number % 3]), number), route, settings[number % 3])
        for number, route in enumerate(routes)
    ]
    single = world()
    singly = [
        drive_episode(single, Many(), route=task.route, setting=task.setting, seed=task.episode.seed, agent_name="many")
        for task in tasks
    ]
    together = drive_together(world, Many, tasks, width=4)
    assert [bits(result) for result in together] == [bits(result) for result in singly]


ORDER_SETTINGS = ("clean", "3 s burst frame drop and GPS noise 5 m", "occlusion 0.5 and 200 ms latency")
ROUTE_IDS = ("801", "3201", "4401")


class Spy:
    """Drives by GPS towards the plan and remembers a digest of every byte that it was given."""

    def sensors(self) -> list[CameraSpec]:
        return [
            CameraSpec("front", width_px=64, height_px=36),
            CameraSpec("left", yaw_deg=-55, width_px=48, height_px=32),
        ]

    def reset(self, route: GlobalPlan, seed: int) -> None:
        self.digest = hashlib.blake2b(repr(route).encode())

    def act(self, observation: Observation) -> Control:
        for name in sorted(observation.cameras):
            image = observation.cameras[name]
            self.digest.update(image.pixels.tobytes() + str(image.tick).encode())
            image.pixels[:] = 7  # scribbling must not change what comes next
        self.digest.update(repr((observation.gps, observation.speed, observation.imu, observation.compass)).encode())
        return Control(throttle=0.35, steer=0.02 * (observation.tick % 7 - 3))


def fingerprints(order: list[tuple[str, str]]) -> dict[str, str]:
    routes = {route.id: route for route in named_routes("full")}
    simulator, agent = EmbeddedSimulator(SimulatorOptions(tick_cap=120)), Spy()
    found = {}
    for route_id, setting in order:
        result = drive_episode(
            simulator, agent, route=routes[route_id], setting=Setting.parse(setting), seed=5, agent_name="spy"
        )
        assert result.ticks > 50, result.end_detail
        found[f"{route_id} {setting}"] = f"{result.trace.digest} {agent.digest.hexdigest()}"
    return found


ORDER = [(route_id, setting) for route_id in ROUTE_IDS for setting in ORDER_SETTINGS]


def test_order_and_process_change_nothing() -> None:
    forwards = fingerprints(ORDER)
    backwards = fingerprints(ORDER[::-1])
    assert backwards == forwards
    assert len(set(forwards.values())) == len(ORDER)
    here = os.path.dirname(__file__)
    code = f"import sys; sys.path[:0] = {[here, *sys.path]!r}; import {__name__} as t; print(t.fingerprints(t.ORDER))"
    fresh = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True, text=True, check=True, env={**os.environ, "PYTHONHASHSEED": "77"},
    )  # fmt: skip
    assert fresh.stdout.strip() == str(forwards)
