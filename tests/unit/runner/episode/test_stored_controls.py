"""The controls of a stored episode drive the same world to the same bits."""

from __future__ import annotations

from collections.abc import Sequence

import pytest

from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.observation import CameraSpec, Observation
from pytest_drive_robust.domain.outcome import Outcome
from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.domain.route import GlobalPlan
from pytest_drive_robust.perturbations import Setting
from pytest_drive_robust.runner.episode.loop import drive_episode
from pytest_drive_robust.runner.episode.stored_controls import StoredControls
from pytest_drive_robust.runner.replay.recording import difference
from pytest_drive_robust.simulators.base import SimulatorOptions
from pytest_drive_robust.store.record import decode_episode, encode_episode
from pytest_drive_robust.testing import FakeSimulator, fake_route


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
