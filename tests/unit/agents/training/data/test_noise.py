"""Bursts of steering noise."""

from __future__ import annotations

import numpy as np
import pytest

from drive_robust_agents._vehicle import mkz
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


def test_noise_turns_as_seven_degrees_of_a_plain_cars_wheels_at_most_and_less_at_speed() -> None:
    for speed_mps, curvature_per_m in ((5.0, 0.12 / 2.85), (20.0, 3.0 / 20.0**2)):
        turned = mkz.moved(speed_mps, Control(0.0, burst_steer(-1.0, speed_mps))).turn_rad
        assert turned / 0.05 == pytest.approx(-curvature_per_m, rel=0.02)
