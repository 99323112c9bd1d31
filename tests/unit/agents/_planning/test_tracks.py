"""Where others are expected to drive and to walk."""

from __future__ import annotations

import math

import numpy as np
import pytest
from privileged_scene import actor, seen, street

from drive_robust_agents._planning.tracks import tracks
from pytest_drive_robust.domain.truth import ActorKind


def test_cars_are_expected_to_follow_their_lane_and_to_finish_a_lane_change() -> None:
    changing = actor(60.0, 2.0, speed_mps=8.0, yaw_rad=-0.2)
    _, traffic = seen(street(changing))
    assert traffic.forecast[0, 0, :2] == pytest.approx((60.0, 2.0))
    assert traffic.forecast[0, 15, 0] == pytest.approx(60.0 + 8.0 * 3.0, abs=0.5)
    assert traffic.forecast[0, 15, 1] == pytest.approx(0.0, abs=0.05)


def test_walkers_are_expected_to_walk_straight_on() -> None:
    walker = actor(60.0, 5.0, speed_mps=2.0, yaw_rad=-math.pi / 2.0, kind=ActorKind.PEDESTRIAN)
    _, traffic = seen(street(walker))
    assert traffic.forecast[0, 10, :2] == pytest.approx((60.0, 1.0), abs=1e-6)


def test_at_a_fork_traffic_is_expected_where_somebody_was_seen_to_go() -> None:
    fork = np.concatenate([np.column_stack([np.arange(11.0), np.zeros(11), np.zeros(11)]) for _ in range(3)])
    fork[11:22, 0] += 10.0  # straight on
    fork[22:, 0] = 10.0  # to the right
    fork[22:, 1], fork[22:, 2] = np.arange(11.0), math.pi / 2.0
    fork = np.column_stack([fork, np.cos(fork[:, 2]), np.sin(fork[:, 2])])
    owner, first = np.repeat(np.arange(3), 11), np.array([0, 11, 22, 33])
    car = np.array([[5.0, 0.0, 0.0, 5.0, 4.6, 1.9, 0.0, 1.0, 0.0]])
    nobody = np.zeros(0, dtype=np.int64)
    for after, ends in ((1, (15.0, 0.0)), (2, (10.0, 5.0))):
        behind = np.array([after, -1, -1])
        found = tracks(car, np.array([1]), fork, owner, first, behind, np.zeros(4, dtype=np.int64), nobody, 10)
        assert found[0, 10, :2] == pytest.approx(ends, abs=0.01)
