from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from stream_factory import observation_at, started

from pytest_drive_robust.domain.observation import Image
from pytest_drive_robust.perturbations import FrameBlend


@settings(max_examples=40, deadline=None)
@given(st.integers(1, 40), st.sampled_from(["uniform", "linear"]), st.integers(0, 2**32 - 1), st.integers(1, 90))
def test_every_image_is_the_rounded_weighted_mean_of_the_last_ones(
    frames: int, weights: str, seed: int, count: int
) -> None:
    images = np.random.default_rng(seed).integers(0, 256, (count, 3, 4, 3), dtype=np.uint8)
    images[::7] = 255  # the largest sums must fit as well
    images.setflags(write=False)
    stack = started(FrameBlend(frames, weights=weights))  # type: ignore[arg-type]
    for tick, image in enumerate(images):
        shown = stack.observe(observation_at(tick, pixels=image)).cameras["front"]
        last = images[max(0, tick + 1 - frames) : tick + 1].astype(np.int64)
        weight = np.arange(1, len(last) + 1) if weights == "linear" else np.ones(len(last), dtype=np.int64)
        total = np.tensordot(weight, last, axes=1)
        assert np.array_equal(shown.pixels, (total + weight.sum() // 2) // weight.sum())
        assert shown.tick == tick


@pytest.mark.parametrize(("frames", "weights"), [(256, "uniform"), (257, "uniform"), (22, "linear"), (23, "linear")])
def test_the_brightest_images_do_not_overflow(frames: int, weights: str) -> None:
    white = np.full((2, 2, 3), 255, dtype=np.uint8)
    stack = started(FrameBlend(frames, weights=weights))  # type: ignore[arg-type]
    for tick in range(2 * frames):
        assert np.all(stack.observe(observation_at(tick, pixels=white)).cameras["front"].pixels == 255)


def test_one_frame_is_the_image_itself() -> None:
    clean = observation_at(3)
    assert started(FrameBlend(1)).observe(clean) is clean


def test_cameras_do_not_mix() -> None:
    stack = started(FrameBlend(2))
    for tick in range(3):
        observation = observation_at(tick, cameras=("front", "rear"))
        dark = observation.cameras["rear"].pixels * np.uint8(0)
        rear = type(observation.cameras["rear"])(dark, tick)
        seen = stack.observe(observation.map_images(lambda name, image, rear=rear: rear if name == "rear" else image))
        assert np.all(seen.cameras["rear"].pixels == 0)


def test_delivered_images_do_not_change_later() -> None:
    stack = started(FrameBlend(3))
    first = stack.observe(observation_at(100)).cameras["front"].pixels
    before = first.copy()
    for tick in range(101, 110):
        stack.observe(observation_at(tick))
    assert np.array_equal(first, before)


def test_a_slow_camera_and_a_frozen_one_are_blended_by_their_images() -> None:
    stack = started(FrameBlend(2))
    images = [np.full((2, 2, 3), value, dtype=np.uint8) for value in (0, 100, 200)]
    shown = []
    for tick in range(6):
        slow = Image(images[tick // 2], 2 * (tick // 2))  # every other tick
        observation = observation_at(tick).map_images(lambda name, image, slow=slow: slow)
        shown.append(int(stack.observe(observation).cameras["front"].pixels[0, 0, 0]))
    assert shown == [0, 0, 50, 50, 150, 150]
