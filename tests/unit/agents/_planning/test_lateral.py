"""Lateral profiles: the way back onto one, and how long a shift takes."""

from __future__ import annotations

import numpy as np
import pytest
from privileged_scene import seen, street

from drive_robust_agents._planning.lateral import path_of, shift_length_m

# --- where to drive ---


def test_the_way_back_onto_the_lane_starts_where_the_ego_is_and_heads() -> None:
    scene, _ = seen(street())
    path = path_of(scene, np.zeros(scene.count), 20.0, 1.0, speed_mps=8.0, drift=-0.05)
    assert path[20, 1] == pytest.approx(1.0, abs=1e-6)
    assert path[20, 2] == pytest.approx(-0.05, abs=0.03)
    assert np.abs(path[60:, 1]).max() < 1e-6
    assert np.all(np.abs(path[20:, 1]) <= 1.0 + 1e-9)


def test_a_shift_takes_longer_at_speed() -> None:
    assert shift_length_m(12.0, 3.5) > shift_length_m(2.0, 3.5) > shift_length_m(2.0, 1.0)
