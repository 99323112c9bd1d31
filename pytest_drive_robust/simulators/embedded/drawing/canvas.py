"""Inputs of the camera kernels (view, boxes around the camera, ground), and the memory that the kernels draw in."""

from __future__ import annotations

import functools
import math
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pytest_drive_robust.arithmetic.scalars import cos_sin, tan
from pytest_drive_robust.domain.observation import CameraSpec
from pytest_drive_robust.jit.arrays import Bytes3, Floats1, Floats2, Ints1, Ints2, Packed1, Packed2

Triple = tuple[float, float, float]
"""A colour, or a place or direction."""

ACROSS, DOWN, OFFSET, FARTHEST, NEAREST, BOX, SIDE, PACKED, RED, GREEN, BLUE, GLOW = range(12)
LIGHT, EXTRA, PATTERN, ALONG_RIGHT, ALONG_UP, ALONG_FORWARD, START_M, DISTANCE_M = range(12, 20)
FACE_COLUMNS = 20
"""Columns of `Canvas.table`, one row for each face that was drawn.

The inverse depth (1/m) of a face at the place (u, v) of the picture is ACROSS * u + DOWN * v + OFFSET, within
FARTHEST..NEAREST. BOX is the face's row among the boxes, SIDE 0 to 5 the front, right, rear, left, top and bottom.
`shade.py` fills in the other columns of the faces that are seen. PACKED is the final colour 0x00BBGGRR of a face of one
colour, else -1. RED, GREEN, BLUE (0..255) are lit but without haze; LIGHT and EXTRA are the light of sun and sky, and
of the ego's headlamps, on the face. With a PATTERN (not 0) ALONG is the unit vector from the face's first corner to its
second in camera axes, START_M where the camera's centre lies on it, DISTANCE_M how far that is from the face's plane.
"""
UNLIT = -2.0
"""PACKED of a face before `shade.py` meets its first pixel."""
_MOST_FACES = 5  # most faces of one box seen at once: a frustum seen from above shows its top and all four sides
_LOWEST_M = 0.05


class Canvas(NamedTuple):
    """Arrays of one camera; (height, width) unless another shape is given.

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
        """Return an empty canvas of this size."""
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
        """Return this canvas, or a canvas with the same arrays and room for `boxes` boxes."""
        needed = 1 + boxes * _MOST_FACES
        if len(self.table) >= needed:
            return self
        return self._replace(
            table=np.zeros((needed, FACE_COLUMNS), np.float64), order=np.zeros(boxes, np.int64), keys=np.zeros(boxes)
        )


class CameraView(NamedTuple):
    """A camera in the world: metres, cosines and sines of its yaw (clockwise from east) and pitch (up), focal length.

    A point `forward`, `right`, `up` of the camera is seen at u = width / 2 + focal * right / forward and
    v = height / 2 - focal * up / forward; the centre of pixel (row, column) is (column + 0.5, row + 0.5).
    """

    x_m: float
    y_m: float
    z_m: float
    focal_px: float
    cos_yaw: float
    sin_yaw: float
    cos_pitch: float
    sin_pitch: float

    @classmethod
    def of(cls, camera: CameraSpec, x_m: float, y_m: float, yaw_rad: float) -> CameraView:
        """Return the view of `camera` on a vehicle whose centre is at (x, y) with this yaw; never below the ground."""
        c, s = cos_sin(yaw_rad)
        turned, focal_px, cos_pitch, sin_pitch = _mount(camera)
        cos_yaw, sin_yaw = cos_sin(yaw_rad + turned) if turned != 0.0 else (c, s)
        return cls(
            x_m + c * camera.x_m - s * camera.y_m,
            y_m + s * camera.x_m + c * camera.y_m,
            max(float(camera.z_m), _LOWEST_M),
            focal_px,
            cos_yaw,
            sin_yaw,
            cos_pitch,
            sin_pitch,
        )


@functools.lru_cache(maxsize=64)  # called in every frame
def _mount(camera: CameraSpec) -> tuple[float, float, float, float]:
    """Return the camera's yaw, focal length, cosine and sine of its pitch, which all of its views share."""
    focal_px = camera.width_px / 2.0 / tan(math.radians(camera.fov_deg) / 2.0)
    return math.radians(camera.yaw_deg), focal_px, *cos_sin(math.radians(camera.pitch_deg))


class Headlamps(NamedTuple):
    """The ego's headlamps: its centre in metres, yaw in radians, and strength 0..1 (0 by day)."""

    x_m: float
    y_m: float
    yaw_rad: float
    strength: float


class FrameScene(NamedTuple):
    """The boxes of one frame.

    `rows` (n, BOX_COLUMNS) are boxes: static boxes up to row `still`, then the boxes of `actors` (k, 10). Actor i has
    the rows from `ends[i]` up to `ends[i + 1]`. `street_lamps` (m, 3) are the `lamp_places`.
    """

    rows: Floats2
    still: int
    ends: Ints1
    actors: Floats2
    street_lamps: Floats2


class CameraGround(NamedTuple):
    """The constant data of one camera on one map in one weather.

    `rows` comes from `ground_rows`, `sky` from `sky_rows`. `texels` and `levels` are those of a `GroundTexture`.
    `clear` (n,) is the share of a colour that the air lets through, by steps of depth (see `shade.py`).
    """

    rows: Floats2
    sky: Packed1
    texels: Packed1
    levels: Floats2
    clear: Annotated[NDArray[np.float32], 1]
