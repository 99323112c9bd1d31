"""Augmentation: equal generators give equal images, and each agent loses what its original lost, nothing else."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from drive_robust_agents.training.recipes.augment import occlude, photometric_gridmask, simlingo_mild, tcp_hard

Pixels = NDArray[np.uint8]
Change = Callable[[Pixels, np.random.Generator], None]
ALL = pytest.mark.parametrize("change", [tcp_hard, simlingo_mild, photometric_gridmask])


def rng(seed: int = 0) -> np.random.Generator:
    return np.random.Generator(np.random.Philox(seed))


def street(*shape: int) -> Pixels:
    """Images without a black pixel that stay so under every change of colour."""
    rows = np.linspace(150, 230, shape[-2], dtype=np.float64)[:, None, None]
    return np.broadcast_to(rows, (*shape, 3)).astype(np.uint8).copy()


def black_block(image: Pixels) -> int:
    """Side of the largest black square, in pixels."""
    black = (image == 0).all(axis=2)
    sides = black.astype(int)
    for i in range(1, len(sides)):
        for j in range(1, sides.shape[1]):
            if black[i, j]:
                sides[i, j] = 1 + min(sides[i - 1, j], sides[i, j - 1], sides[i - 1, j - 1])
    return int(sides.max())


@ALL
@pytest.mark.parametrize("shape", [(6, 64, 128), (3, 2, 48, 80)])
def test_equal_generators_give_equal_images(change: Change, shape: tuple[int, ...]) -> None:
    one, two, other = street(*shape), street(*shape), street(*shape)
    change(one, rng(1))
    change(two, rng(1))
    change(other, rng(2))
    assert one.shape == (*shape, 3)
    assert np.array_equal(one, two)
    assert not np.array_equal(one, other)


@ALL
def test_some_images_change_and_stay_recognisable(change: Change) -> None:
    before, after = street(64, 64, 128), street(64, 64, 128)
    change(after, rng(3))
    changed = [not np.array_equal(a, b) for a, b in zip(before, after, strict=True)]
    assert sum(changed) > 20
    for image in after:  # the ground is still brighter than the sky, where there is anything
        sky, ground = image[:32], image[32:]
        assert ground[ground > 0].mean() > sky[sky > 0].mean()


def test_tcp_loses_blocks_and_more_of_them_with_strength() -> None:
    lost = []
    for strength in (0.0, 1.0):
        images = street(96, 64, 128)
        tcp_hard(images, rng(4), strength)
        blocks = np.array([black_block(image) for image in images])
        assert blocks.max() >= 5
        lost.append((images == 0).all(axis=3).mean())
    assert 0.0 < lost[0] < lost[1] < 0.2


def test_simlingo_never_loses_a_block() -> None:
    images = street(96, 64, 128)
    simlingo_mild(images, rng(5))
    assert (images == 0).all(axis=3).any()
    assert max(black_block(image) for image in images) <= 3


def test_grid_mask_blanks_a_regular_quarter_of_seven_in_ten_samples_in_all_cameras_alike() -> None:
    images = street(200, 2, 48, 80)
    photometric_gridmask(images, rng(6))
    black = (images == 0).all(axis=4)
    assert np.array_equal(black[:, 0], black[:, 1])
    share = black.reshape(200, -1).mean(axis=1)
    masked = share > 0.0
    assert 0.6 < masked.mean() < 0.8
    assert np.median(share[masked]) == pytest.approx(0.25, abs=0.08)


def test_occlusion_is_one_black_rectangle_of_the_size_that_was_asked_for() -> None:
    images = street(100, 64, 128)
    occlude(images, rng(7), chance=0.5, most=0.8)
    black = (images == 0).all(axis=3)
    hit = black.any(axis=(1, 2))
    assert 0.35 < hit.mean() < 0.65
    for mask in black[hit]:
        rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
        assert mask.sum() == len(rows) * len(columns)
        assert np.ptp(rows) + 1 == len(rows) <= 0.8 * 64
        assert np.ptp(columns) + 1 == len(columns) <= 0.8 * 128
    assert np.array_equal(images[~hit], street(100, 64, 128)[~hit])
