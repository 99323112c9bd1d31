"""Augment training images: each agent gets the augmentation of its published original.

The augmentation decides which failures an agent survives. TCP ("hard" set of its `augment.py`): colours, blur, noise,
and missing pixels and *blocks* of the image. UniAD and VAD: photometric distortion and GridMask, which blanks a regular
grid. SimLingo: colours, blur, noise and few missing pixels, never a block (`cutout=False`).

Images are (N, ..., height, width, 3) uint8 and are changed in place. Changes of colour are combined to one matrix, and
noise is cut from a field that is drawn once, so that a front image of 256 x 128 costs about 0.2 ms. Equal generators
give equal images.
"""

from __future__ import annotations

import functools
from collections.abc import Callable

import cv2
import numpy as np
from numpy.typing import NDArray

from pytest_drive_robust.jit.arrays import Pixels

__all__ = ["occlude", "photometric_gridmask", "simlingo_mild", "tcp_hard"]

Matrix = NDArray[np.float64]

_GREY = np.array([0.299, 0.587, 0.114])
_FIELD = 1 << 22


def tcp_hard(images: Pixels, generator: np.random.Generator, strength: float = 1.0) -> None:
    """Apply TCP's set, each part to three in ten images; `strength` (0 to 1) drops more blocks and pixels.

    Up to 4 % (at strength 0) or 20 % (at 1) of the pixels are dropped and, in every second image, of the blocks. A
    block is 8 to 20 % of the image's sides. (imgaug reads these figures as the size of the coarse mask, which gives
    blocks of 5 to 12 pixels; at a quarter of the published resolution the first convolution would average such small
    blocks away.)
    """
    lost = 0.04 + 0.16 * strength

    def change(image: Pixels) -> None:
        chance = generator.random(8)
        _recolour(
            image,
            _grey(generator.random() if chance[0] < 0.3 else 0.0)
            @ _scale(generator.uniform(0.6, 1.6, 3) if chance[1] < 0.3 else np.ones(3))
            @ _contrast(generator.uniform(0.6, 1.4) if chance[2] < 0.3 else 1.0)
            @ _shift(generator.uniform(-25.0, 25.0, 3) if chance[3] < 0.3 else np.zeros(3)),
        )
        if chance[4] < 0.3:
            _blur(image, generator.uniform(0.3, 1.3))
        if chance[5] < 0.3:
            _add_noise(image, generator, generator.uniform(0.0, 0.05))
        if chance[6] < 0.3:
            _drop_pixels(image, generator, generator.uniform(0.0, lost))
        if chance[7] < 0.5:
            _drop_blocks(image, generator, generator.uniform(0.0, lost))

    _each(images, change)


def simlingo_mild(images: Pixels, generator: np.random.Generator) -> None:
    """Apply SimLingo's set: colours, blur, noise and up to a tenth of single pixels; no block goes missing."""

    def change(image: Pixels) -> None:
        chance = generator.random(6)
        _recolour(
            image,
            _grey(generator.random() if chance[0] < 0.2 else 0.0)
            @ _scale(generator.uniform(0.6, 1.4, 3) if chance[1] < 0.2 else np.ones(3))
            @ _contrast(generator.uniform(0.6, 1.4) if chance[2] < 0.2 else 1.0),
        )
        if chance[3] < 0.2:
            _blur(image, generator.uniform(0.3, 1.0))
        if chance[4] < 0.2:
            _add_noise(image, generator, generator.uniform(0.0, 0.05))
        if chance[5] < 0.2:
            _drop_pixels(image, generator, generator.uniform(0.0, 0.1))

    _each(images, change)


def photometric_gridmask(images: Pixels, generator: np.random.Generator) -> None:
    """Apply UniAD's and VAD's set: brightness, contrast, colours per image, then GridMask (0.7) over all cameras.

    Photometric distortion of each camera: brightness +-32, contrast and saturation 0.5 to 1.5, each for every second
    picture. GridMask blanks squares of half a period, with a period of 2 pixels up to the image's height, as published
    with `ratio=0.5`; all cameras of a sample share one grid.
    """

    def change(image: Pixels) -> None:
        chance = generator.random(3)
        _recolour(
            image,
            _shift(np.full(3, generator.uniform(-32.0, 32.0) if chance[0] < 0.5 else 0.0))
            @ _contrast(generator.uniform(0.5, 1.5) if chance[1] < 0.5 else 1.0)
            @ _grey(1.0 - generator.uniform(0.5, 1.5) if chance[2] < 0.5 else 0.0),
        )

    _each(images, change)
    height, width = images.shape[-3:-1]
    for sample in images:
        period = int(generator.integers(2, height))
        down, right = generator.integers(0, period, 2)
        if generator.random() < 0.7:
            size = min(max(int(period * 0.5 + 0.5), 1), period - 1)
            rows = ((np.arange(height) - down) % period < size)[:, None]
            columns = ((np.arange(width) - right) % period < size)[None]
            sample *= (rows | columns).astype(np.uint8)[..., None]


def occlude(images: Pixels, generator: np.random.Generator, *, chance: float, most: float) -> None:
    """Put a black rectangle of up to `most` of either side at a random place of some images."""

    def change(image: Pixels) -> None:
        if generator.random() >= chance:
            return
        ratio, (down, right) = generator.uniform(0.2, most), generator.random(2)
        rows, columns = image.shape[:2]
        height, width = int(rows * ratio), int(columns * ratio)
        top, left = int(down * (rows - height + 1)), int(right * (columns - width + 1))
        image[top : top + height, left : left + width] = 0

    _each(images, change)


def _each(images: Pixels, change: Callable[[Pixels], None]) -> None:
    for image in images.reshape(-1, *images.shape[-3:]):
        change(image)


# --- colours: matrices (4, 4) on (red, green, blue, 1) ---


def _grey(share: float) -> Matrix:
    """Blend towards grey; a negative share saturates."""
    matrix = np.eye(4)
    matrix[:3, :3] = (1.0 - share) * np.eye(3) + share * _GREY
    return matrix


def _scale(factors: Matrix) -> Matrix:
    return np.diag([*factors, 1.0])


def _shift(values: Matrix) -> Matrix:
    matrix = np.eye(4)
    matrix[:3, 3] = values
    return matrix


def _contrast(factor: float) -> Matrix:
    return _shift(np.full(3, 127.5 * (1.0 - factor))) @ _scale(np.full(3, factor))


def _recolour(image: Pixels, matrix: Matrix) -> None:
    if not np.array_equal(matrix, np.eye(4)):
        cv2.transform(image, matrix[:3], image)


# --- sharpness, noise, holes ---


def _blur(image: Pixels, sigma_px: float) -> None:
    cv2.GaussianBlur(image, (5, 5), sigma_px, image)


@functools.cache
def _normal_field() -> tuple[Pixels, Pixels]:
    """Return the positive and negative parts of a fixed field of a few million standard normal numbers times 40."""
    drawn = np.random.Generator(np.random.Philox(7)).standard_normal(_FIELD, dtype=np.float32) * 40.0
    return np.clip(drawn, 0, 255).astype(np.uint8), np.clip(-drawn, 0, 255).astype(np.uint8)


@functools.cache
def _even_field() -> Pixels:
    return np.random.Generator(np.random.Philox(8)).integers(0, 256, _FIELD, dtype=np.uint8)


def _cut(field: Pixels, shape: tuple[int, ...], generator: np.random.Generator) -> tuple[Pixels, int]:
    size = int(np.prod(shape))
    start = int(generator.integers(0, len(field) - size))
    return field[start : start + size].reshape(shape), start


def _add_noise(image: Pixels, generator: np.random.Generator, deviation: float) -> None:
    """Add Gaussian noise to each channel independently; `deviation` is a share of the range."""
    up, down = _normal_field()
    rise, start = _cut(up, image.shape, generator)
    fall = down[start : start + image.size].reshape(image.shape)
    factor = 255.0 * deviation / 40.0
    cv2.add(image, cv2.convertScaleAbs(rise, alpha=factor), image)
    cv2.subtract(image, cv2.convertScaleAbs(fall, alpha=factor), image)


def _drop_pixels(image: Pixels, generator: np.random.Generator, share: float) -> None:
    drawn, _ = _cut(_even_field(), image.shape[:2], generator)
    image[drawn < 256.0 * share] = 0


def _drop_blocks(image: Pixels, generator: np.random.Generator, share: float) -> None:
    """Blacken cells of a coarse grid at a random place; a cell is 8 to 20 % of the image's sides."""
    rows, columns = image.shape[:2]
    side = generator.uniform(0.08, 0.2)
    cells = int(np.ceil(1.0 / side)) + 1
    keep = (generator.random((cells, cells)) >= share).astype(np.uint8)
    height, width = int(cells * side * rows) + 1, int(cells * side * columns) + 1
    mask = cv2.resize(keep, (width, height), interpolation=cv2.INTER_NEAREST).astype(np.uint8, copy=False)
    top, left = int(generator.integers(0, height - rows + 1)), int(generator.integers(0, width - columns + 1))
    image *= mask[top : top + rows, left : left + columns, None]
