"""The agents with six cameras remember what they saw 0.5 s ago, and their can bus says what was sensed."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drive_robust_agents._wrappers.memory import CAN_BUS, Memory, can_bus, motion_between
from drive_robust_agents._wrappers.sensed_pose import SensedPose

POSE = SensedPose(1.0, 2.0, 0.5)
poses = st.tuples(st.floats(-500.0, 500.0), st.floats(-500.0, 500.0), st.floats(-7.0, 7.0))


def filled(ticks: range) -> Memory:
    memory = Memory({"bev": (2,)})
    for tick in ticks:
        memory.keep(tick, SensedPose(float(tick), 0.0, 0.0), {"bev": np.array([tick, -tick], dtype=np.float32)})
    return memory


def test_the_memory_is_that_of_ten_ticks_ago() -> None:
    for now in range(10, 30):
        pose, features = filled(range(now)).recall(now)
        assert pose == SensedPose(now - 10.0, 0.0, 0.0)
        assert features["bev"].tolist() == [now - 10.0, 10.0 - now]


def test_in_the_first_half_second_there_is_no_memory() -> None:
    pose, features = filled(range(9)).recall(9)
    assert pose is None
    assert features["bev"].tolist() == [0.0, 0.0]


def test_where_ticks_are_left_out_the_youngest_memory_that_is_old_enough_counts() -> None:
    assert filled(range(0, 40, 8)).recall(40)[0] == SensedPose(24.0, 0.0, 0.0)


def test_what_is_older_than_a_second_is_no_memory() -> None:
    assert filled(range(10)).recall(40)[0] is None


def test_a_clock_that_goes_back_starts_a_new_memory() -> None:
    memory = filled(range(30))
    memory.keep(5, POSE, {"bev": np.zeros(2, dtype=np.float32)})
    assert memory.recall(30)[0] is None
    assert memory.recall(15)[0] == POSE


def test_a_memory_is_not_changed_by_who_gave_it() -> None:
    memory, given_away = Memory({"bev": (2,)}), np.ones(2, dtype=np.float32)
    memory.keep(0, POSE, {"bev": given_away})
    given_away[:] = 7.0
    assert memory.recall(10)[1]["bev"].tolist() == [1.0, 1.0]


def test_motion_is_forward_and_right_of_where_the_ego_was() -> None:
    east, south = [10.0, 20.0, 0.0], [10.0, 20.0, math.pi / 2.0]
    moved = motion_between(np.array([east, south]), np.array([[13.0, 21.0, 0.1], [13.0, 21.0, -math.pi]]))
    assert moved[0] == pytest.approx([3.0, 1.0, 0.1], abs=1e-5)
    assert moved[1] == pytest.approx([1.0, -3.0, math.pi / 2.0], abs=1e-5)


@given(poses, poses)
def test_a_point_is_at_the_same_place_in_both_frames(old: tuple[float, ...], now: tuple[float, ...]) -> None:
    forward, right, yaw = map(float, motion_between(np.array([old]), np.array([now]))[0])
    x, y = 5.0, -3.0
    then = (forward + math.cos(yaw) * x - math.sin(yaw) * y, right + math.sin(yaw) * x + math.cos(yaw) * y)
    assert _world(old, then) == pytest.approx(_world(now, (x, y)), abs=2e-3)


def _world(pose: tuple[float, ...], point: tuple[float, float]) -> tuple[float, float]:
    c, s = math.cos(pose[2]), math.sin(pose[2])
    return pose[0] + c * point[0] - s * point[1], pose[1] + s * point[0] + c * point[1]


def test_the_can_bus_holds_what_its_names_say() -> None:
    imu = np.array([[0.5, -0.2, 0.1]], dtype=np.float32)
    row = can_bus(np.array([7.0], dtype=np.float32), imu, np.array([[3.5, 0.2, 0.05]], dtype=np.float32))[0]
    assert dict(zip(CAN_BUS, row.tolist(), strict=True)) == pytest.approx(
        {
            "speed": 7.0,
            "yaw rate": 0.1,
            "forward acceleration": 0.5,
            "right acceleration": -0.2,
            "forward movement": 3.5,
            "movement right": 0.2,
        }
    )
