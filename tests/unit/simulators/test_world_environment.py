"""The embedded world by gymnasium's conventions."""

from __future__ import annotations

import gymnasium
import numpy as np
from gymnasium.utils.env_checker import check_env

import pytest_drive_robust.simulators.gymnasium_ids  # noqa: F401 -- registers the id
from pytest_drive_robust import CameraSpec
from pytest_drive_robust.simulators.embedded.environment import WorldEnv


def test_gymnasium_finds_nothing_to_complain_about() -> None:
    check_env(WorldEnv(cameras=(CameraSpec("front", width_px=64, height_px=36),)), skip_render_check=True)


def test_it_is_registered_under_its_name() -> None:
    env = gymnasium.make("drive_robust/World-v0")
    observed, info = env.reset(seed=3, options={"route": "101"})
    assert info["route"] == "101"
    assert observed["speed"].shape == (1,)
    total = 0.0
    for _ in range(100):
        observed, reward, *_ = env.step(np.array([0.5, 0.0, 0.0], np.float32))
        total += float(reward)
    assert observed["speed"][0] > 3.0
    assert total > 5.0
    env.close()


def test_a_collision_costs() -> None:
    env = WorldEnv()
    env.reset(seed=0, options={"route": "601"})
    rewards = [env.step(np.array([0.6, 0.0, 0.0], np.float32))[1] for _ in range(200)]
    assert min(rewards) < -5.0


def test_the_picture_is_a_bird_s_eye_view() -> None:
    env = WorldEnv(render_mode="rgb_array")
    env.reset(seed=0)
    picture = env.render()
    assert picture.dtype == np.uint8
    assert picture.shape == (512, 512, 3)
    assert picture.std() > 5
