"""Every agent of drive-robust-agents keeps the contract that any third party's agent must keep."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import pytest

from pytest_drive_robust.domain.route import Route
from pytest_drive_robust.metrics.score import is_success
from pytest_drive_robust.perturbations import Setting
from pytest_drive_robust.registry.registry import default_registry
from pytest_drive_robust.runner.episode.loop import drive_episode
from pytest_drive_robust.simulators.base import SimulatorOptions
from pytest_drive_robust.simulators.embedded import EmbeddedSimulator
from pytest_drive_robust.simulators.embedded.route_sets import named_routes
from pytest_drive_robust.testing import check_agent

ROUTES = named_routes("one-per-scenario")
AGENTS = ("blind", "blind:speed=11", "classical", "constant", "expert", "random", "reactive")
CLEAN_SUCCESSES = {"expert": (40, 2), "classical": (20, 4)}
"""At least so many of the 44 routes, seed 0; without `--whole-studies` every n-th of them is driven."""


@pytest.mark.parametrize("name", AGENTS)
def test_the_contract_is_kept(name: str) -> None:
    registry = default_registry()
    route = next(route for route in ROUTES if route.scenario.type == "ParkingCutIn")
    report = check_agent(lambda: registry.agent(name), simulator=EmbeddedSimulator(), route=route, subject=name)
    assert report.ok, str(report)


def test_only_two_are_privileged() -> None:
    registry = default_registry()
    assert [name for name in AGENTS if getattr(registry.agent(name), "privileged", False)] == ["expert", "reactive"]


@pytest.mark.slow
@pytest.mark.parametrize("name", CLEAN_SUCCESSES)
def test_clean_successes(name: str, sample: Callable[[Sequence[Route], int], Sequence[Route]]) -> None:
    at_least, every = CLEAN_SUCCESSES[name]
    routes = sample(ROUTES, every)
    simulator, agent = EmbeddedSimulator(SimulatorOptions(stuck_stop_s=30.0)), default_registry().agent(name)
    results = [
        drive_episode(simulator, agent, route=route, setting=Setting.CLEAN, seed=0, agent_name=name) for route in routes
    ]
    failed = [f"{result.episode.route_id}: {result.end_detail}" for result in results if not is_success(result)]
    assert len(routes) - len(failed) >= at_least * len(routes) / len(ROUTES), failed
