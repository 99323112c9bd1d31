"""The controls of a stored episode drive the same world to the same bits, and those of one that died give its score."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import pytest

from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.episode import Episode
from pytest_drive_robust.domain.observation import CameraSpec, Observation
from pytest_drive_robust.domain.outcome import End, Outcome
from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.domain.route import GlobalPlan
from pytest_drive_robust.domain.truth import WorldState
from pytest_drive_robust.perturbations import InferenceLatency, Setting
from pytest_drive_robust.runner.episode.loop import drive_episode
from pytest_drive_robust.runner.episode.stored_controls import RecordedControls, StoredControls, drive_again
from pytest_drive_robust.runner.episode.watch import Watch
from pytest_drive_robust.runner.plan import EpisodeRequest
from pytest_drive_robust.runner.replay.recording import difference
from pytest_drive_robust.simulators.base import SimulatorOptions
from pytest_drive_robust.store.record import decode_episode, encode_episode
from pytest_drive_robust.testing import FakeSimulator, ScriptedAgent, fake_route


class Uneven:
    """Its controls need all 53 bits of a double; it breaks down at a tick, when it is told to."""

    def __init__(self, breaks_at: int = 10**9) -> None:
        self._breaks_at = breaks_at

    def sensors(self) -> Sequence[CameraSpec]:
        return ()

    def reset(self, route: GlobalPlan, seed: int) -> None:
        self.factor = seed + 1 / 3

    def act(self, observation: Observation) -> Control:
        if observation.tick >= self._breaks_at:
            raise RuntimeError("broken")
        self.factor = (self.factor * 997.0 + observation.gps.x_m) % 1.0
        return Control(throttle=self.factor, steer=0.2 * self.factor - 0.1)


def driven(agent: object, setting: str) -> EpisodeResult:
    world = FakeSimulator(SimulatorOptions(tick_cap=60))
    result = drive_episode(
        world,
        agent,
        route=fake_route(),
        setting=Setting.parse(setting),
        seed=3,
        agent_name="uneven",  # type: ignore[arg-type]
    )
    return decode_episode(encode_episode(result))


@pytest.mark.parametrize("setting", ["clean", "200 ms latency and GPS noise 5 m", "100 ms latency"])
def test_the_trajectory_comes_back_bit_for_bit_without_agent_and_setting(setting: str) -> None:
    stored = driven(Uneven(), setting)
    again = driven(StoredControls.of(stored), "clean")
    assert difference(again, stored) == ""
    assert (again.end, again.infractions, again.ticks) == (stored.end, stored.infractions, stored.ticks)


def test_it_ends_where_the_stored_agent_broke_down_and_says_so() -> None:
    stored = driven(Uneven(breaks_at=20), "clean")
    again = driven(StoredControls.of(stored), "clean")
    assert stored.outcome is Outcome.AGENT_ERROR
    assert difference(again, stored) == ""
    assert "the stored episode ended here: agent_error" in again.end_detail


ROUTE = fake_route()
LOST_AT = 40


class Keeps(Watch):
    """Keeps what the shared state of a worker keeps."""

    def __init__(self) -> None:
        self.recorded = RecordedControls((), (), privileged=False, asked=(), applied=())

    def equip(self, cameras: tuple[CameraSpec, ...], consumes: tuple[str, ...], *, privileged: bool) -> None:
        self.recorded = replace(self.recorded, cameras=cameras, consumes=consumes, privileged=privileged)

    def ticked(
        self, tick: int, state: WorldState, observation: Observation, asked: Control | None, applied: Control
    ) -> None:
        known = self.recorded
        self.recorded = replace(known, asked=(*known.asked, asked), applied=(*known.applied, applied))


def drive_until_lost(setting: Setting) -> tuple[EpisodeResult, RecordedControls]:
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


def salvage(recorded: RecordedControls, setting: Setting, simulator: FakeSimulator | None = None) -> EpisodeResult:
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
    found = salvage(RecordedControls((), (), privileged=False, asked=(), applied=()), Setting.CLEAN)
    assert (found.outcome, found.end, found.ticks) == (Outcome.AGENT_ERROR, End.AGENT_CRASHED, 0)
    assert found.route_completion_pct == 0.0


def test_a_privileged_agent_stays_one() -> None:
    _, recorded = drive_until_lost(Setting.CLEAN)
    assert salvage(replace(recorded, privileged=True), Setting.CLEAN).privileged


def test_a_world_that_breaks_is_no_score() -> None:
    _, recorded = drive_until_lost(Setting.CLEAN)
    broken = FakeSimulator(raises=RuntimeError("lost the server"), raises_at=3)
    assert salvage(recorded, Setting.CLEAN, broken).outcome is Outcome.INFRA_ERROR
