"""What the executor of this process says before its first episode."""

from __future__ import annotations

import cv2
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.episode import Episode
from pytest_drive_robust.domain.observation import Observation
from pytest_drive_robust.perturbations import Setting
from pytest_drive_robust.registry.registry import Registry, default_registry
from pytest_drive_robust.runner.inline_executor import InlineExecutor
from pytest_drive_robust.runner.plan import EpisodeRequest
from pytest_drive_robust.simulators.base import SimulatorOptions
from pytest_drive_robust.simulators.embedded import compiling
from pytest_drive_robust.testing import FakeSimulator, ScriptedAgent, fake_route


@pytest.mark.parametrize(("simulator", "said"), [("embedded", (0, 7)), ("gymnasium:highway-v0", (0, 0))])
def test_it_says_how_many_functions_the_embedded_world_lacks(
    simulator: str, said: tuple[int, int], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(compiling, "missing_functions", lambda: 7)
    options = SimulatorOptions()
    inline = InlineExecutor(default_registry(), simulator=simulator, options=options, ticked=lambda: None)
    assert inline.compiling == said


def threads() -> set[int]:
    return {library["num_threads"] for library in threadpool_info()} | {cv2.getNumThreads()}


def test_what_is_driven_here_computes_with_one_thread_as_in_a_worker_process() -> None:
    seen: list[set[int]] = []

    class Counting(ScriptedAgent):
        def act(self, observation: Observation) -> Control:
            seen.append(threads())
            return super().act(observation)

    registry = Registry()
    registry.register_agent("counting", lambda: Counting([Control(throttle=1.0)]))
    registry.register_simulator("fake", FakeSimulator)
    inline = InlineExecutor(registry, simulator="fake", options=SimulatorOptions(tick_cap=5), ticked=lambda: None)
    assert inline.work is not None
    request = EpisodeRequest(Episode("counting", "1", "clean", 0), fake_route("1"), Setting.CLEAN)
    with threadpool_limits(limits=2):
        before = cv2.getNumThreads()
        cv2.setNumThreads(2)
        try:
            future = inline.submit(request)
            while not future.done():
                inline.work()
            assert threads() == {2}
        finally:
            cv2.setNumThreads(before)
    inline.close()
    assert future.result().ticks == len(seen) > 0
    assert set(map(frozenset, seen)) == {frozenset({1})}
