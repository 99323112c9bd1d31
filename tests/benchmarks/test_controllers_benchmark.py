"""`benchmarks/controllers.py`: the perfect network tells where the expert is now, whenever it is asked."""

from __future__ import annotations

import math

import pytest
from controllers import Perfect, Steer, by_waypoints

from drive_robust_agents._wrappers import tuning
from drive_robust_agents._wrappers.pid import Point
from pytest_drive_robust import Control
from pytest_drive_robust.domain.truth import EgoState
from pytest_drive_robust.perturbations import Setting
from pytest_drive_robust.runner.episode.loop import drive_episode
from pytest_drive_robust.simulators.base import SimulatorOptions
from pytest_drive_robust.simulators.embedded import EmbeddedSimulator
from pytest_drive_robust.simulators.embedded.route_sets import named_routes

EVERY = 6


@pytest.mark.parametrize("sentence", ["clean", "200 ms latency (mode=hold)"])
def test_a_future_ages_by_ticks_of_the_world_and_not_by_calls(sentence: str) -> None:
    world = EmbeddedSimulator(SimulatorOptions(tick_cap=80))
    asked: list[tuple[int, int]] = []
    behind: list[float] = []

    def make() -> Steer:
        steer = by_waypoints(tuning.UNIAD, 6)()

        def noting(net: Perfect, ego: EgoState, mps: float, target: Point) -> Control:
            asked.append((world.state.tick, net.age_ticks))
            (forward, _), *_ = net.waypoints(ego, 0.05, 1)
            behind.append(-forward)
            return steer(net, ego, mps, target)

        return noting

    agent = Perfect(world, make, horizon_s=3.0, every=EVERY)
    route = named_routes("one-per-scenario")[0]
    result = drive_episode(world, agent, route=route, setting=Setting.parse(sentence), seed=0, agent_name="perfect")
    assert result.ticks == 80, result.end_detail
    branched = -math.inf
    for tick, age in asked:
        branched = tick if tick - branched >= EVERY else branched
        assert age == tick - branched
    assert max(behind) < 0.5, "the next waypoint lies behind the vehicle: the future is older than it is said to be"
