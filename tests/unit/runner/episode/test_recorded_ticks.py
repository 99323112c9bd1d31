"""The ticks of an episode whose process ended give its score."""

from __future__ import annotations

from dataclasses import replace

import pytest

from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.episode import Episode
from pytest_drive_robust.domain.observation import CameraSpec, Observation
from pytest_drive_robust.domain.outcome import End, Outcome
from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.domain.truth import WorldState
from pytest_drive_robust.perturbations import InferenceLatency, Setting
from pytest_drive_robust.runner.episode.loop import drive_episode
from pytest_drive_robust.runner.episode.recorded_ticks import RecordedTicks, drive_again
from pytest_drive_robust.runner.episode.watch import Watch
from pytest_drive_robust.runner.plan import EpisodeRequest
from pytest_drive_robust.testing import FakeSimulator, ScriptedAgent, fake_route

ROUTE = fake_route()
LOST_AT = 40


class Keeps(Watch):
    """Keeps what the shared state of a worker keeps."""

    def __init__(self) -> None:
        self.recorded = RecordedTicks((), (), privileged=False, asked=(), applied=())

    def equip(self, cameras: tuple[CameraSpec, ...], consumes: tuple[str, ...], *, privileged: bool) -> None:
        self.recorded = replace(self.recorded, cameras=cameras, consumes=consumes, privileged=privileged)

    def ticked(
        self, tick: int, state: WorldState, observation: Observation, asked: Control | None, applied: Control
    ) -> None:
        known = self.recorded
        self.recorded = replace(known, asked=(*known.asked, asked), applied=(*known.applied, applied))


def drive_until_lost(setting: Setting) -> tuple[EpisodeResult, RecordedTicks]:
    """An agent that raises, and what is known of it."""
    asked: list[Control] = []

    def act(observation: Observation) -> Control:
        if len(asked) == LOST_AT:
            raise RuntimeError("lost")
        asked.append(Control(throttle=min(1.0, 0.5 + observation.tick / 100.0), steer=0.01))
        return asked[-1]

    cameras = (CameraSpec("front", width_px=8, height_px=8),)
    agent, keeps = ScriptedAgent(act, cameras=cameras, consumes=("cameras", "speed")), Keeps()
    result = drive_episode(FakeSimulator(), agent, route=ROUTE, setting=setting, seed=2, agent_name="lost", watch=keeps)
    return result, keeps.recorded


def salvage(recorded: RecordedTicks, setting: Setting, simulator: FakeSimulator | None = None) -> EpisodeResult:
    episode = Episode("lost", ROUTE.id, str(setting), 2)
    return drive_again(simulator or FakeSimulator(), recorded, EpisodeRequest(episode, ROUTE, setting))


@pytest.mark.parametrize("sentence", ["clean", "200 ms latency", "200 ms latency (mode=hold)", "occlusion 0.5"])
def test_everything_but_the_end_is_as_if_the_agent_had_raised(sentence: str) -> None:
    setting = Setting.parse(sentence)
    lost, recorded = drive_until_lost(setting)
    found = salvage(recorded, setting)
    assert lost.ticks >= LOST_AT
    assert found.trace.digest == lost.trace.digest
    assert (found.outcome, found.episode, found.schedule, found.reception) == (
        lost.outcome,
        lost.episode,
        lost.schedule,
        lost.reception,
    )
    assert found.route_completion_pct == lost.route_completion_pct > 0.0


def test_where_the_clock_decided_the_world_still_goes_the_recorded_way() -> None:
    setting = Setting.of(InferenceLatency(ms=200.0))
    lost, recorded = drive_until_lost(setting)
    measured = Setting.parse("measured latency")  # gives the recorded controls another delay
    found = salvage(recorded, measured)
    assert found.trace.digest == lost.trace.digest
    assert found.episode.setting == "measured latency"
    assert found.outcome is Outcome.AGENT_ERROR


def test_an_agent_that_was_lost_before_it_drove_has_driven_nothing() -> None:
    found = salvage(RecordedTicks((), (), privileged=False, asked=(), applied=()), Setting.CLEAN)
    assert (found.outcome, found.end, found.ticks) == (Outcome.AGENT_ERROR, End.AGENT_CRASHED, 0)
    assert found.route_completion_pct == 0.0


def test_a_privileged_agent_stays_one() -> None:
    _, recorded = drive_until_lost(Setting.CLEAN)
    assert salvage(replace(recorded, privileged=True), Setting.CLEAN).privileged


def test_a_world_that_breaks_is_no_score() -> None:
    _, recorded = drive_until_lost(Setting.CLEAN)
    broken = FakeSimulator(raises=RuntimeError("lost the server"), raises_at=3)
    assert salvage(recorded, Setting.CLEAN, broken).outcome is Outcome.INFRA_ERROR
