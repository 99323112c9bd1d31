"""Poses beside the expert's way, and the free space for them."""

from __future__ import annotations

import math

import numpy as np
from training_drives import route_of

from drive_robust_agents.training.data.draws import draws
from drive_robust_agents.training.data.expert_episode import ExpertEpisode
from drive_robust_agents.training.data.poses import FreeSpace, Pose, draw_pose
from pytest_drive_robust.domain.truth import EgoState, WorldState


def test_drawn_poses_keep_their_ranges() -> None:
    ego = EgoState(3.0, 4.0, 0.7, 6.0, 0.0, 0.0, 0.0, 4.9, 1.8)
    rng = draws("poses")
    poses = [draw_pose(ego, rng) for _ in range(400)]
    aside = np.array([(p.y_m - 4.0) * math.cos(0.7) - (p.x_m - 3.0) * math.sin(0.7) for p in poses])
    assert np.abs(aside).min() >= 0.3
    assert np.abs(aside).max() <= 1.5
    assert 0.4 < (aside > 0.0).mean() < 0.6
    assert max(abs(p.yaw_rad - 0.7) for p in poses) <= math.radians(15.0)
    assert 0.05 < np.mean([p.start for p in poses]) < 0.16
    assert all(p.speed_mps == 0.0 for p in poses if p.start)
    changed = np.mean([p.speed_mps != 6.0 and not p.start for p in poses])
    assert 0.25 < changed < 0.42
    fast = EgoState(0.0, 0.0, 0.0, 20.0, 0.0, 0.0, 0.0, 4.9, 1.8)
    assert max(abs(draw_pose(fast, rng).yaw_rad) for _ in range(200)) <= 0.125


def test_there_is_room_on_the_road_but_not_beside_it_nor_in_somebody() -> None:
    simulator = ExpertEpisode.begin(route_of("ParkedObstacle"), seed=0).simulator
    room, state = FreeSpace(simulator.world.lane_map), simulator.state
    x, y, yaw, _ = simulator.truth().route[30]
    assert room.is_free(state, Pose(x, y, yaw, 0.0))
    assert not room.is_free(state, Pose(x - 30.0 * math.sin(yaw), y + 30.0 * math.cos(yaw), yaw, 0.0))
    body = state.actors[0]
    assert not room.is_free(state, Pose(body[WorldState.X], body[WorldState.Y], body[WorldState.YAW], 0.0))
