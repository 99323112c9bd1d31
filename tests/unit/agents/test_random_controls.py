"""The agent `random`: a new control every half second, however seldom it is asked."""

from __future__ import annotations

import pytest

from drive_robust_agents.random_controls import RandomControls
from pytest_drive_robust import Compass, Control, GlobalPlan, Gps, Imu, Observation, Speed


def _asked_every(ticks: int, agent: RandomControls | None = None) -> list[tuple[int, Control]]:
    """Return the ticks at which the control changed, and to what, in a new episode of the agent."""
    agent = agent or RandomControls()
    agent.reset(GlobalPlan(()), 7)
    changes: list[tuple[int, Control]] = []
    for tick in range(0, 100, ticks):
        control = agent.act(
            Observation(tick, Gps(0.0, 0.0, tick), Compass(0.0, tick), Imu(0.0, 0.0, 0.0, tick), Speed(0.0, tick), {})
        )
        if not changes or control != changes[-1][1]:
            changes.append((tick, control))
    return changes


@pytest.mark.parametrize("ticks", [1, 2, 3, 4, 7])
def test_it_draws_at_the_first_call_of_every_half_second(ticks: int) -> None:
    first_calls = [-(-half // ticks) * ticks for half in range(0, 100, 10)]
    asked = _asked_every(ticks)
    assert [tick for tick, _ in asked] == [tick for tick in first_calls if tick < 100]
    assert [control for _, control in asked] == [control for _, control in _asked_every(1)][: len(asked)]


def test_a_reset_starts_the_sequence_anew() -> None:
    agent = RandomControls()
    assert _asked_every(4, agent) == _asked_every(4, agent)
