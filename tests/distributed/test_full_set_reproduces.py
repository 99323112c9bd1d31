"""The whole shipped set, driven in two processes and in opposite orders, gives the same bytes."""

from __future__ import annotations

import multiprocessing
from concurrent.futures import ProcessPoolExecutor

import pytest

from pytest_drive_robust import Setting
from pytest_drive_robust.registry.registry import default_registry
from pytest_drive_robust.runner.episode.loop import drive_episode
from pytest_drive_robust.simulators.base import SimulatorOptions
from pytest_drive_robust.simulators.embedded import EmbeddedSimulator
from pytest_drive_robust.simulators.embedded.routes import named_routes


def digests(order: int) -> dict[str, str]:
    """The trace digest and the end of every route, driven first to last (1) or last to first (-1)."""
    simulator = EmbeddedSimulator(SimulatorOptions(stuck_stop_s=10.0))
    agent = default_registry().agent("expert")
    found = {}
    for route in named_routes("full")[::order]:
        result = drive_episode(simulator, agent, route=route, setting=Setting.CLEAN, seed=3, agent_name="expert")
        found[route.id] = f"{result.trace.digest} {result.end_detail} {len(result.infractions)}"
    return found


@pytest.mark.slow
def test_two_processes_and_both_orders_give_the_same_bytes() -> None:
    with ProcessPoolExecutor(2, mp_context=multiprocessing.get_context("spawn")) as pool:
        forwards, backwards = pool.map(digests, (1, -1))
    assert len(forwards) == 220
    assert backwards == forwards
    assert len(set(forwards.values())) == 220
