"""Lidar and radar of the leaderboard in a world of upright boxes."""

from __future__ import annotations

import math

import numpy as np
import pytest
from leaderboard_files import CAR_AHEAD, truth_with

from pytest_drive_robust.bench2drive.agents.official_rig import LIDAR, RADAR, Sensor
from pytest_drive_robust.bench2drive.agents.ray_sensors import detections, sweep
from pytest_drive_robust.domain.truth import ActorKind
from pytest_drive_robust.perturbations.context import Draws

ROOF = Sensor(LIDAR, "LIDAR", z_m=2.5)


def whole_turn(*actors, sensor=ROOF):
    return np.concatenate([sweep(sensor, truth_with(*actors, tick=tick)) for tick in (0, 1)])


def test_an_empty_world_gives_rings_on_the_ground():
    points = whole_turn()
    assert np.allclose(points[:, 2], -2.5, atol=1e-5)
    distances = np.hypot(points[:, 0], points[:, 1])
    assert distances.min() == pytest.approx(2.5 / math.tan(math.radians(30.0)), rel=1e-4)
    assert np.sqrt(distances**2 + 2.5**2).max() <= 85.0
    assert ((points[:, 3] > 0.7) & (points[:, 3] <= 1.0)).all()


def test_a_tick_sees_half_a_turn_and_the_next_one_the_other_half():
    right, left = (sweep(ROOF, truth_with(tick=tick)) for tick in (0, 1))
    assert (right[:, 1] > 0).all()
    assert (left[:, 1] < 0).all()


def test_a_car_ahead_is_met_at_its_rear_and_shades_the_ground_behind_it():
    points = whole_turn(CAR_AHEAD)
    standing = points[points[:, 2] > -2.4]
    assert len(standing) > 20
    assert standing[:, 0].min() == pytest.approx(20.0, abs=1e-3)  # 22 m less half of 4 m
    assert standing[:, 0].max() < 24.0 + 1e-3
    assert np.abs(standing[:, 1]).max() < 1.0 + 1e-3
    assert standing[:, 2].max() <= 1.5 - 2.5 + 1e-5
    shaded = (np.abs(points[:, 1]) < 0.5) & (points[:, 0] > 24.0) & (points[:, 0] < 40.0) & (points[:, 2] < -2.4)
    assert not shaded.any()


def test_the_nearer_of_two_things_is_met():
    wall = (ActorKind.CONTAINER, 10.0, 0.0, 0.0, 0.0, 1.0, 8.0, 4.0)
    points = whole_turn(CAR_AHEAD, wall)
    ahead = points[(np.abs(points[:, 1]) < 0.5) & (points[:, 0] > 0.0)]
    assert ahead[:, 0].max() == pytest.approx(9.5, abs=1e-3)


def test_a_turned_mount_turns_the_points():
    points = whole_turn(CAR_AHEAD, sensor=Sensor(LIDAR, "LIDAR", z_m=2.5, yaw_deg=90.0))
    standing = points[points[:, 2] > -2.4]
    assert standing[:, 1].max() < -20.0 + 1e-3  # what is ahead of the car is at the left of the sensor


def test_dirt_on_the_road_is_flat():
    dirt = (ActorKind.DIRT, 15.0, 0.0, 0.0, 0.0, 4.0, 4.0, 1.0)
    assert np.array_equal(whole_turn(dirt), whole_turn())


def test_radar_gives_depth_angles_and_closing_speed():
    radar = Sensor(RADAR, "RADAR", z_m=1.0, horizontal_fov_deg=10.0, vertical_fov_deg=6.0)
    draws = Draws(0, "route", "radar")
    found = np.concatenate([detections(radar, truth_with(CAR_AHEAD, tick=tick), draws) for tick in range(5)])
    assert found.dtype == np.float32
    car = found[(np.abs(found[:, 0] - 20.0) < 0.2) & (found[:, 1] > math.radians(-2.7))]  # above the ground
    assert len(car) > 100
    assert np.abs(np.degrees(found[:, 2])).max() <= 5.0 + 1e-3
    assert np.abs(np.degrees(found[:, 1])).max() <= 3.0 + 1e-3
    assert car[:, 3] == pytest.approx(-4.0, abs=0.05)  # 2 m/s ahead of 6 m/s
    ground = found[found[:, 0] < 19.0]
    assert (ground[:, 3] < -5.9).all()


def test_radar_is_the_same_for_the_same_seed():
    radar = Sensor(RADAR, "RADAR", z_m=1.0)
    one, other = (detections(radar, truth_with(CAR_AHEAD), Draws(3, "route", "radar")) for _ in range(2))
    assert np.array_equal(one, other)
