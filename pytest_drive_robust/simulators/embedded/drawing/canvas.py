"""The memory of one camera: what the kernels hand to each other, allocated once."""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pytest_drive_robust.jit.arrays import Bytes3, Floats1, Floats2, Ints1, Ints2, Packed1, Packed2

__all__ = ["FACE_COLUMNS", "UNLIT", "Canvas"]

ACROSS, DOWN, OFFSET, FARTHEST, NEAREST, BOX, SIDE, PACKED, RED, GREEN, BLUE, GLOW = range(12)
LIGHT, EXTRA, PATTERN, ALONG_RIGHT, ALONG_UP, ALONG_FORWARD, START_M, DISTANCE_M = range(12, 20)
FACE_COLUMNS = 20
"""Columns of `Canvas.table`, one row for each face that was drawn.

At the place (u, v) of the picture a face is ACROSS * u + DOWN * v + OFFSET per metre near, within FARTHEST..NEAREST.
BOX is its row among the boxes, SIDE 0 to 5 the front, right, rear, left, top and bottom. The rest is filled in by
`shade.py` for faces that are seen: PACKED is the final colour 0x00BBGGRR where it is one for the whole face, else -1.
RED, GREEN, BLUE (0..255) are lit but not yet behind any air; LIGHT and EXTRA are how sun and sky, and the ego's
headlamps, light the face. With a PATTERN (not 0) ALONG is the unit vector from the face's first corner to its second
in camera axes, START_M where the camera's centre lies on it, DISTANCE_M how far that is from the face's plane.
"""
UNLIT = -2.0
"""PACKED of a face of which `shade.py` has not yet seen a pixel."""


class Canvas(NamedTuple):
    """Arrays of one camera; (height, width) unless said otherwise.

    `pixels` (height, width, 3) uint8 is the picture, a view of `words`. `colours` is uint32, 0x00BBGGRR. `faces` int32
    says which row of `table` is seen there (0: ground or sky); `nearness` float32 is its inverse depth in 1/m.
    `touched` (height, 2) are the first and the end column of a row where a box may be seen; outside of them `faces` and
    `nearness` are 0. `edges` (height, 2), `sums` (width,), `order` and `keys` (n,) are scratch. `table` is
    (n, FACE_COLUMNS) float64; its row 0 is not used.
    """

    words: Packed1
    pixels: Bytes3
    colours: Packed2
    faces: Annotated[NDArray[np.int32], 2]
    nearness: Annotated[NDArray[np.float32], 2]
    touched: Ints2
    edges: Floats2
    sums: Annotated[NDArray[np.uint64], 1]
    table: Floats2
    order: Ints1
    keys: Floats1

    @classmethod
    def of(cls, width_px: int, height_px: int) -> Canvas:
        """Return an empty canvas: nothing is seen yet."""
        shape = (height_px, width_px)
        words = np.zeros((height_px * width_px * 3 + 3) // 4, np.uint32)
        return cls(
            words=words,
            pixels=words.view(np.uint8)[: height_px * width_px * 3].reshape(*shape, 3),
            colours=np.zeros(shape, np.uint32),
            faces=np.zeros(shape, np.int32),
            nearness=np.zeros(shape, np.float32),
            touched=np.zeros((height_px, 2), np.int64),
            edges=np.zeros((height_px, 2), np.float64),
            sums=np.zeros(width_px, np.uint64),
            table=np.zeros((1, FACE_COLUMNS), np.float64),
            order=np.zeros(0, np.int64),
            keys=np.zeros(0, np.float64),
        )

    def with_room(self, boxes: int) -> Canvas:
        """Return this canvas, or one that shares its arrays but has room for so many boxes."""
        needed = 1 + boxes * _MOST_FACES
        if len(self.table) >= needed:
            return self
        return self._replace(
            table=np.zeros((needed, FACE_COLUMNS), np.float64), order=np.zeros(boxes, np.int64), keys=np.zeros(boxes)
        )


_MOST_FACES = 5  # of a box that are seen at once: a frustum seen from above shows its top and all four sides
