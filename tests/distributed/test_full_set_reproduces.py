"""The shipped set, driven in two processes and in opposite orders, gives the same bytes."""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor

import pytest

from pytest_drive_robust import Setting
from pytest_drive_robust.registry.registry import default_registry
from pytest_drive_robust.runner.episode.loop import drive_episode
from pytest_drive_robust.simulators.base import SimulatorOptions
from pytest_drive_robust.simulators.embedded import EmbeddedSimulator
from pytest_drive_robust.simulators.embedded.route_sets import named_routes


def digests(names: Sequence[str]) -> dict[str, str]:
    """The trace digest and the end of every route, driven in this order."""
    simulator = EmbeddedSimulator(SimulatorOptions(stuck_stop_s=10.0))
    agent = default_registry().agent("expert")
    found = {}
    routes = {route.id: route for route in named_routes("full")}
    for name in names:
        route = routes[name]
        result = drive_episode(simulator, agent, route=route, setting=Setting.CLEAN, seed=3, agent_name="expert")
        found[name] = f"{result.trace.digest} {result.end_detail} {len(result.infractions)}"
    return found


@pytest.mark.slow
def test_two_processes_and_both_orders_give_the_same_bytes(sample: Callable[[list[str], int], list[str]]) -> None:
    names = sample([route.id for route in named_routes("full")], 20)  # one of every fourth scenario type
    with ProcessPoolExecutor(2, mp_context=multiprocessing.get_context("spawn")) as pool:
        forwards, backwards = pool.map(digests, (names, names[::-1]))
    assert len(forwards) == len(names)
    assert backwards == forwards
    assert len(set(forwards.values())) == len(names)
