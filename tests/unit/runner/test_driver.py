"""An agent that draws in its constructor is the same agent in every order, process and batch."""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest

from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.episode import Episode
from pytest_drive_robust.domain.observation import CameraSpec, Observation
from pytest_drive_robust.domain.route import GlobalPlan, Route
from pytest_drive_robust.domain.truth import WorldState
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.perturbations.base import Setting
from pytest_drive_robust.plugin.probe_option import drive_twice
from pytest_drive_robust.registry.registry import Registry
from pytest_drive_robust.runner.driver import EpisodeDriver, make_agent
from pytest_drive_robust.runner.episode.generators import seed_generators
from pytest_drive_robust.runner.executor import Executor
from pytest_drive_robust.runner.inline_executor import InlineExecutor
from pytest_drive_robust.runner.plan import EpisodeRequest
from pytest_drive_robust.runner.replay.recording import record_episode
from pytest_drive_robust.simulators.base import SimulatorOptions
from pytest_drive_robust.testing import FakeSimulator, fake_route

ROUTES = {route.id: route for route in (fake_route("1"), fake_route("2", length_m=30.0))}


class DrawsOnce:
    """Drives by what its constructor drew from the generators of Python and numpy."""

    def __init__(self) -> None:
        self.share = self.draw()

    @staticmethod
    def draw() -> float:
        return (random.random() + float(np.random.rand())) / 2.0

    def sensors(self) -> list[CameraSpec]:
        return []

    def reset(self, route: GlobalPlan, seed: int) -> None:
        """Nothing is kept from episode to episode."""

    def act(self, observation: Observation) -> Control:
        return Control(throttle=0.5 + self.share / 2.0)

    @staticmethod
    def act_batch(agents: Sequence[DrawsOnce], observations: Sequence[Observation]) -> list[Control]:
        return [agent.act(seen) for agent, seen in zip(agents, observations, strict=True)]


class DrawsFromTorch(DrawsOnce):
    """Drives by what its constructor drew from the generator of torch."""

    @staticmethod
    def draw() -> float:
        torch: Any = pytest.importorskip("torch")
        return float(torch.rand(()))


class DrawsAlways(DrawsOnce):
    """Draws once in its constructor and again in every tick."""

    def act(self, observation: Observation) -> Control:
        return Control(throttle=(self.share + self.draw()) / 2.0)


@pytest.fixture
def registry() -> Registry:
    made = Registry()
    for agent in (DrawsOnce, DrawsFromTorch, DrawsAlways):
        made.register_agent(agent.__name__, agent)
    made.register_simulator("fake", FakeSimulator)
    return made


def one_by_one(registry: Registry) -> Executor:
    return InlineExecutor(registry, simulator="fake", options=SimulatorOptions(), ticked=lambda: None)


def in_lockstep(registry: Registry) -> Executor:
    return InlineExecutor(registry, simulator="fake", options=SimulatorOptions(), ticked=lambda: None, width=4)


def digests(executor: Executor, agent: str, route_ids: str) -> dict[str, str]:
    """The digest of every route, driven in this order."""
    episodes = [Episode(agent, name, "clean", 0) for name in route_ids]
    futures = [
        executor.submit(EpisodeRequest(item, ROUTES[item.route_id], Setting.CLEAN, f"{item}")) for item in episodes
    ]
    while not all(future.done() for future in futures):
        executor.work()  # type: ignore[attr-defined]
    executor.close()
    return {name: future.result().trace.digest for name, future in zip(route_ids, futures, strict=True)}


@pytest.mark.parametrize("agent", ["DrawsOnce", "DrawsFromTorch", "DrawsAlways"])
def test_a_route_that_is_driven_first_or_second_is_driven_alike(registry: Registry, agent: str) -> None:
    there, back, alone = (digests(one_by_one(registry), agent, order) for order in ("12", "21", "2"))
    assert there == back
    assert there["2"] == alone["2"]


@pytest.mark.parametrize("agent", ["DrawsOnce", "DrawsFromTorch"])
def test_in_lockstep_it_drives_as_it_does_alone(registry: Registry, agent: str) -> None:
    alone = digests(one_by_one(registry), agent, "12")
    assert digests(in_lockstep(registry), agent, "12") == digests(in_lockstep(registry), agent, "21") == alone


@pytest.mark.parametrize("agent", ["DrawsOnce", "DrawsAlways"])
def test_a_replay_drives_what_the_run_drove(registry: Registry, agent: str) -> None:
    driven = digests(one_by_one(registry), agent, "12")
    tape = record_episode(
        FakeSimulator(),
        make_agent(registry, agent),
        route=ROUTES["2"],
        setting=Setting.CLEAN,
        seed=0,
        agent_name=agent,
    )
    assert tape.result.trace.digest == driven["2"]


def test_an_agent_whose_draws_a_run_repeats_needs_one_seed(registry: Registry) -> None:
    episode = Episode("DrawsAlways", "1", "clean", 0)
    request = EpisodeRequest(episode, ROUTES["1"], Setting.CLEAN)
    first, second = drive_twice(request, registry, FakeSimulator())
    assert first.trace.digest == second.trace.digest
    assert first.trace.digest == digests(one_by_one(registry), "DrawsAlways", "1")["1"]


def test_agents_of_two_names_draw_differently(registry: Registry) -> None:
    registry.register_agent("other", DrawsOnce)
    one, again, other = (make_agent(registry, name) for name in ("DrawsOnce", "DrawsOnce", "other"))
    assert one.share == again.share != other.share  # type: ignore[attr-defined]


def python_draw() -> float:
    return random.random()


def numpy_draw() -> float:
    return float(np.random.rand())


def torch_draw() -> float:
    torch: Any = pytest.importorskip("torch")
    return float(torch.rand(()))


@pytest.mark.parametrize("draw", [python_draw, numpy_draw, torch_draw])
def test_making_an_agent_and_driving_it_leave_the_generators_as_they_were(
    registry: Registry, draw: Callable[[], float]
) -> None:
    draw()  # imports torch
    seed_generators("mine")
    expected = [draw(), draw()]
    seed_generators("mine")
    found = [draw()]
    make_agent(registry, "DrawsFromTorch" if draw is torch_draw else "DrawsOnce")
    digests(one_by_one(registry), "DrawsAlways", "12")
    assert [*found, draw()] == expected


class Noted(FakeSimulator):
    """A world that tells which of its kind are open."""

    open: dict[int, Noted]

    def reset(self, route: Route, *, seed: int, cameras: Sequence[CameraSpec]) -> WorldState:
        assert id(self) in self.open
        return super().reset(route, seed=seed, cameras=cameras)

    def close(self) -> None:
        del self.open[id(self)]


class TimedOutTest(BaseException):
    """What a timeout for tests raises wherever the process is."""


class CutOff(DrawsOnce):
    """In whose first tick that happens."""

    def act(self, observation: Observation) -> Control:
        raise TimedOutTest

    @staticmethod
    def act_batch(agents: Sequence[DrawsOnce], observations: Sequence[Observation]) -> list[Control]:
        raise TimedOutTest


def no_weights() -> DrawsOnce:
    raise UsageError("no weights")


@pytest.mark.parametrize(
    ("agent", "error"),
    [(CutOff, TimedOutTest), (no_weights, UsageError)],
    ids=["cut off in a tick", "without its agent"],
)
@pytest.mark.parametrize("width", [None, 4])
def test_an_episode_that_does_not_end_leaves_no_world_open(
    agent: Callable[[], DrawsOnce], error: type[BaseException], width: int | None
) -> None:
    Noted.open = {}

    def make() -> Noted:
        made = Noted()
        Noted.open[id(made)] = made
        return made

    driver = EpisodeDriver(make, lambda name: agent() if name == "cut" else DrawsOnce())
    well, cut = (
        EpisodeRequest(Episode(name, "1", "clean", 0), ROUTES["1"], Setting.CLEAN) for name in ("draws", "cut")
    )
    before = driver.drive_once(well, width)
    for _ in range(3):
        with pytest.raises(error):
            driver.drive_once(cut, width)
        assert len(Noted.open) <= 1
    assert driver.drive_once(well, width).trace.digest == before.trace.digest
    driver.close()
    assert Noted.open == {}
