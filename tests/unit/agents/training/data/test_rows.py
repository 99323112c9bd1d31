"""The cameras of an agent in one episode."""

from __future__ import annotations

from drive_robust_agents.training.data.rigs import TRAINING_RIGS


def test_cameras_of_every_rig_see_each_tick_anew() -> None:
    assert all(camera.rate_hz == 20.0 for one in TRAINING_RIGS.values() for camera in one.cameras)
