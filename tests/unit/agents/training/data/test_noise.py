"""Bursts of steering noise."""

from __future__ import annotations

import numpy as np
import pytest

from drive_robust_agents._planning.vehicle import Bicycle, Mkz
from drive_robust_agents.training.data.draws import draws
from drive_robust_agents.training.data.noise import burst_plan, burst_steer
from pytest_drive_robust import Control


def test_four_in_ten_episodes_have_bursts_of_half_a_second_to_a_second() -> None:
    plans = [burst_plan(draws("plan", k), 600) for k in range(300)]
    noisy = [plan for plan in plans if plan.any()]
    assert 0.3 < len(noisy) / len(plans) < 0.5
    for plan in noisy:
        edges = np.flatnonzero(np.diff(np.concatenate([[0], (plan != 0.0).astype(int), [0]]))).reshape(-1, 2)
        whole = edges[edges[:, 1] < 600]
        assert ((whole[:, 1] - whole[:, 0] >= 10) & (whole[:, 1] - whole[:, 0] <= 20)).all()
        assert np.abs(plan).max() <= 1.0


def test_noise_turns_the_wheels_by_seven_degrees_at_most_and_less_at_speed() -> None:
    assert burst_steer(1.0, 5.0) == pytest.approx(0.12 / 0.61)
    assert burst_steer(-1.0, 20.0) * 0.61 * 20.0**2 / 2.85 == pytest.approx(-3.0)


def test_noise_pushes_the_mkz_as_much_as_the_bicycle() -> None:
    for speed_mps in (2.0, 15.0):
        steer = [burst_steer(1.0, speed_mps, vehicle=made) for made in (Bicycle(), Mkz())]
        turned = [
            made.moved(speed_mps, Control(0.0, s)).turn_rad for made, s in zip((Bicycle(), Mkz()), steer, strict=True)
        ]
        assert turned[1] == pytest.approx(turned[0], rel=0.02)
