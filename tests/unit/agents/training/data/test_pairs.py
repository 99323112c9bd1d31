"""Which frame shows the same drive half a second before."""

from __future__ import annotations

import numpy as np

from drive_robust_agents.training.data.pairs import earlier_rows


def test_pairs_are_half_a_second_apart_in_one_episode() -> None:
    episode = np.array([0, 0, 0, 1, 1])
    tick = np.array([0, 5, 10, 10, 20])
    assert earlier_rows(episode, tick, np.zeros(5)).tolist() == [-1, -1, 0, -1, 3]


def test_a_shifted_frame_remembers_what_was_driven_and_is_not_remembered_itself() -> None:
    source = np.array([0, 1, 1, 2, 0])
    tick = np.array([0, 0, 10, 10, 10])
    assert earlier_rows(np.zeros(5), tick, source).tolist() == [-1, -1, 0, 0, 0]
    assert earlier_rows(np.zeros(2), np.array([0, 10]), np.array([1, 0])).tolist() == [-1, -1]


def test_the_order_of_frames_does_not_matter_to_pairs() -> None:
    rng = np.random.default_rng(3)
    episode, tick = rng.integers(0, 4, 200), rng.integers(0, 60, 200)
    found = earlier_rows(episode, tick, np.zeros(200))
    for row, earlier in enumerate(found):
        there = {int(k) for k in np.flatnonzero((episode == episode[row]) & (tick == tick[row] - 10))}
        assert (int(earlier) in there) if there else earlier == -1
