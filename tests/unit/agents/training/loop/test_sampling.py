"""Which frames a training sees, and how often."""

# ruff: noqa: E402 - without torch, which is an extra, these tests are skipped before the imports that need it

from __future__ import annotations

import pytest

torch = pytest.importorskip("torch")
import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from drive_robust_agents.training.data.draws import draws
from drive_robust_agents.training.loop.sampling import bucket_weights, draw_epoch, level_types


def test_what_is_rare_and_matters_is_seen_more_and_standing_less() -> None:
    still = np.zeros((6, 12, 4), np.float32)
    columns = {
        "speed": np.array([0.0, 0.0, 8.0, 8.0, 8.0, 8.0], np.float32),
        "future": still,
        "controls": np.zeros((6, 5, 3), np.float32),
        "command": np.full((6, 2), 4, np.int8),
        "tag": np.zeros(6, np.int16),
    }
    still[1:, -1, 0] = 20.0
    still[1, 7, 3] = 3.0  # starts
    columns["controls"][3, 1, 2] = 0.8  # brakes
    still[4, -1, 2] = 0.8  # turns
    columns["command"][5] = 5  # changes the lane
    assert bucket_weights(columns).tolist() == [0.4, 4.0, 1.0, 2.0, 2.0, 2.5]


@given(st.lists(st.integers(1, 400), min_size=2, max_size=44), st.integers(0, 99))
def test_no_scenario_type_falls_below_the_floor(counts: list[int], seed: int) -> None:
    tags = np.repeat(np.arange(len(counts)), counts)
    weights = np.random.Generator(np.random.Philox(seed)).uniform(0.4, 4.0, len(tags))
    leveled = level_types(weights, tags)
    shares = np.bincount(tags, weights=leveled)
    assert leveled.sum() == pytest.approx(1.0)
    assert shares.min() >= min(0.02, 0.9 / len(counts)) * (1.0 - 1e-9)
    for tag in range(len(counts)):  # within a type nothing changes
        mine = tags == tag
        assert np.allclose(leveled[mine] / leveled[mine].sum(), weights[mine] / weights[mine].sum())


def test_types_above_the_floor_keep_their_proportions() -> None:
    tags = np.repeat([0, 1, 2], [600, 399, 1])
    shares = np.bincount(tags, weights=level_types(np.ones(1000), tags))
    assert shares[2] == pytest.approx(0.02)
    assert shares[0] / shares[1] == pytest.approx(600 / 399)


@given(st.integers(2, 200), st.integers(0, 1000))
def test_a_pass_visits_each_row_as_often_as_its_weight_says(size: int, seed: int) -> None:
    weights = draws("weights", seed).uniform(0.1, 5.0, size)
    counts = np.bincount(draw_epoch(weights, draws("pass", seed)), minlength=size)
    wanted = size * weights / weights.sum()
    assert counts.sum() == size
    assert (np.abs(counts - wanted) < 1.0 + 1e-6).all()
