"""Inner functions are parts of entry points; each entry point is compiled for its annotated types and no others."""

from __future__ import annotations

import numpy as np
import pytest

from drive_robust_agents.classical import Classical
from drive_robust_agents.expert import Expert
from pytest_drive_robust import Setting
from pytest_drive_robust.jit.arrays import Floats1
from pytest_drive_robust.jit.kernels import ENTRIES, inner, uncached_entry
from pytest_drive_robust.jit.libraries import TESTED, is_tested
from pytest_drive_robust.jit.signatures import argument_types
from pytest_drive_robust.runner.episode.loop import drive_episode
from pytest_drive_robust.simulators.base import SimulatorOptions
from pytest_drive_robust.simulators.embedded import EmbeddedSimulator
from pytest_drive_robust.simulators.embedded.route_sets import named_routes


@inner
def twice(x: float) -> float:
    return 2.0 * x


@inner
def four_times(x: float) -> float:
    return twice(twice(x))


@uncached_entry
def by_both_ways(row: Floats1) -> float:
    return twice(row[0]) + four_times(row[0])


def test_a_part_of_a_part_is_linked_once() -> None:
    assert by_both_ways(np.array((3.0,))) == 18.0


def test_python_cannot_call_a_part() -> None:
    if is_tested():
        with pytest.raises(TypeError):
            four_times(1.0)


def test_the_tested_releases_of_numba() -> None:
    assert is_tested(".".join(str(number) for number in TESTED[0]) + ".0")
    assert not is_tested("0.59.1")
    assert not is_tested("1.0.0")


@pytest.mark.parametrize("agent", [Classical, Expert])
def test_an_episode_compiles_each_entry_point_for_its_annotations_only(agent: type[Classical] | type[Expert]) -> None:
    simulator = EmbeddedSimulator(SimulatorOptions(tick_cap=60))
    for route in named_routes("dev10")[:2]:
        drive_episode(simulator, agent(), route=route, setting=Setting.parse("clean"), seed=0, agent_name="some")
    driven = [kernel for kernel in ENTRIES if kernel.signatures and kernel.py_func.__module__ != __name__]
    assert {kernel.__name__ for kernel in driven} >= {"tick", "pack_world"}
    for kernel in driven:
        assert kernel.signatures == [argument_types(kernel.py_func)], kernel.__name__
