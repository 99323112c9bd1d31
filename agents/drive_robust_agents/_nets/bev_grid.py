"""The bird's-eye grid of UniAD and VAD, and the image places of its cells: plain geometry, no parameters.

Cells lie in the ego frame (x forward, y right). Rows are equally long. Columns are narrow in the middle, to tell lanes
apart, and wide at the sides: column coordinate t in -1..1 stands at y = aside * sinh(bend t) / sinh(bend). The
published BEVFormer grids have square cells (200 x 200 of 0.5 m), which a grid of 40 x 16 cells cannot afford.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pytest_drive_robust import CameraSpec, rig
from pytest_drive_robust.arithmetic import arrays, scalars
from pytest_drive_robust.jit.arrays import Floats

__all__ = ["OUT_OF_SIGHT", "BevSpec", "TokensInSight", "camera_views", "project"]

Floats32 = NDArray[np.float32]
Indices = NDArray[np.int64]

OUT_OF_SIGHT = -1.0e4
"""Attention bias where a cell may not look; finite, so that half precision and ONNX can represent it."""

_NEAREST_M = 0.5


@dataclass(frozen=True, slots=True)
class BevSpec:
    """Sizes of the grid in metres of the ego frame, and of the pictures and tokens, in pixels of every camera.

    `cameras` are names of the `nuscenes` rig; `heights_m` are the points of a cell's pillar, one for each head of the
    lift's attention (the published three, and one where lamps hang); `token_px` is the side of an image token.
    """

    cameras: tuple[str, ...] = ("front", "front_left", "front_right", "back", "back_left", "back_right")
    image_width_px: int = 160
    image_height_px: int = 96
    token_px: int = 8
    width: int = 64
    heights_m: tuple[float, ...] = (0.2, 1.0, 1.8, 4.2)
    rows: int = 40
    columns: int = 16
    behind_m: float = 16.0
    ahead_m: float = 64.0
    aside_m: float = 32.0
    bend: float = 2.0

    @property
    def cells(self) -> int:
        """Number of cells of the grid."""
        return self.rows * self.columns

    def rig(self) -> tuple[CameraSpec, ...]:
        """Return the cameras, in the order of `cameras`."""
        specs = rig("nuscenes", width_px=self.image_width_px, height_px=self.image_height_px)
        known = {camera.name: camera for camera in specs}
        return tuple(known[name] for name in self.cameras)

    def centres(self, *, finer: int = 1) -> Floats32:
        """Return the cells' middles x, y [m], each cell cut `finer` x `finer`: (rows * finer, columns * finer, 2)."""
        ahead = (np.arange(self.rows * finer) + 0.5) / (self.rows * finer)
        aside = (np.arange(self.columns * finer) + 0.5) / (self.columns * finer) * 2.0 - 1.0
        x = -self.behind_m + (self.behind_m + self.ahead_m) * ahead
        y = self.aside_m * arrays.sinh(self.bend * aside) / scalars.sinh(self.bend)
        return np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).astype(np.float32)

    def sizes(self) -> Floats32:
        """Return the length and width (rows, columns, 2) of the cells [m]."""
        edges = arrays.sinh(self.bend * np.linspace(-1.0, 1.0, self.columns + 1)) / scalars.sinh(self.bend)
        width = self.aside_m * np.diff(edges)
        length = np.full(self.rows, (self.behind_m + self.ahead_m) / self.rows)
        return np.stack(np.meshgrid(length, width, indexing="ij"), axis=-1).astype(np.float32)


@dataclass(frozen=True, slots=True)
class TokensInSight:
    """The cells that one camera sees, and their image tokens.

    `cells` (n,) are numbers of cells (row * columns + column). `bias` (heads, n, tokens) is added to the attention of
    each head. Its value is minus half the squared distance, in tokens, at the 3 x 3 tokens around the projection of the
    head's point of the pillar, and `OUT_OF_SIGHT` elsewhere.
    """

    cells: Indices
    bias: Floats32


def camera_views(spec: BevSpec) -> tuple[TokensInSight, ...]:
    """Return the view of each camera of the rig, in order."""
    return tuple(_view(spec, camera) for camera in spec.rig())


def _view(spec: BevSpec, camera: CameraSpec) -> TokensInSight:
    points = spec.centres().reshape(-1, 2).astype(np.float64)
    pixels, inside = np.zeros((len(spec.heights_m), len(points), 2)), np.zeros(len(points), np.bool_)
    for head, height_m in enumerate(spec.heights_m):
        u, v, before = project(camera, points[:, 0], points[:, 1], height_m)
        seen = before & (u >= 0.0) & (u < camera.width_px) & (v >= 0.0) & (v < camera.height_px)
        inside |= seen
        pixels[head, :, 0], pixels[head, :, 1] = u, v
    cells = np.flatnonzero(inside)
    limits = np.array([camera.width_px, camera.height_px]) - 1e-6
    at = np.clip(pixels[:, cells], 0.0, limits) / spec.token_px
    columns, rows = camera.width_px // spec.token_px, camera.height_px // spec.token_px
    middle = np.stack(np.meshgrid(np.arange(columns), np.arange(rows)), axis=-1).reshape(-1, 2)
    near = (np.abs(np.floor(at)[:, :, None] - middle) <= 1.0).all(axis=-1)
    away = ((at[:, :, None] - (middle + 0.5)) ** 2).sum(axis=-1)
    return TokensInSight(cells, np.where(near, -0.5 * away, OUT_OF_SIGHT).astype(np.float32))


def project(camera: CameraSpec, x_m: Floats, y_m: Floats, z_m: float) -> tuple[Floats, Floats, NDArray[np.bool_]]:
    """Return u, v in pixels of points of the ego frame at height `z_m`, and whether each point is before the camera.

    The centre of pixel (row, column) is (column + 0.5, row + 0.5). The pixels of points behind the camera have no
    meaning.
    """
    yaw, pitch = math.radians(camera.yaw_deg), math.radians(camera.pitch_deg)
    focal_px = camera.width_px / 2.0 / scalars.tan(math.radians(camera.fov_deg) / 2.0)
    dx, dy, dz = x_m - camera.x_m, y_m - camera.y_m, z_m - camera.z_m
    level = dx * scalars.cos(yaw) + dy * scalars.sin(yaw)
    right = dy * scalars.cos(yaw) - dx * scalars.sin(yaw)
    forward = level * scalars.cos(pitch) + dz * scalars.sin(pitch)
    up = dz * scalars.cos(pitch) - level * scalars.sin(pitch)
    safe = np.maximum(forward, _NEAREST_M)
    u, v = camera.width_px / 2.0 + focal_px * right / safe, camera.height_px / 2.0 - focal_px * up / safe
    return u, v, forward > _NEAREST_M
