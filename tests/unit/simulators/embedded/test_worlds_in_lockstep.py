"""Worlds that take turns in one process are as independent as worlds in processes of their own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from lockstep_agents import drive_together

from drive_robust_agents.classical import Classical
from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.episode import Episode
from pytest_drive_robust.domain.observation import Observation
from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.perturbations import Setting
from pytest_drive_robust.runner.episode.loop import drive_episode
from pytest_drive_robust.runner.plan import EpisodeRequest
from pytest_drive_robust.simulators.base import SimulatorOptions
from pytest_drive_robust.simulators.embedded import EmbeddedSimulator
from pytest_drive_robust.simulators.embedded.routes import named_routes
from pytest_drive_robust.store.record import encode_episode


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
