"""The only solid that the cameras know: a box whose top may be smaller or larger than its bottom.

Boxes are rows of one float64 array, so that kernels fill and draw them without touching Python.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from pytest_drive_robust.arithmetic.scalars import cos, sin
from pytest_drive_robust.jit.arrays import Floats

X, Y, Z, COS, SIN, ALONG, WIDE, HIGH, FRONT, REAR, SIDES, RED, GREEN, BLUE, GLOW, MATERIAL, SEED, REACH = range(18)
INSTANCE = 18
"""Columns of a box row: the fields of `Box`; `COS` and `SIN` of the yaw; `INSTANCE` is the actor's id or -1."""
BOX_COLUMNS = 19


class Material(IntEnum):
    """The pattern on a box's upright faces."""

    PLAIN = 0
    FACADE = 1
    STRIPES = 2
    RIBS = 3


@dataclass(frozen=True, slots=True)
class Box:
    """One box: centre x, y and bottom z in metres, yaw in radians, length, width, height in metres.

    `sides_m` is how far the top face is drawn in at each side (negative: the top juts out). `colour` is RGB 0..255;
    `glow` 0..1 is the share of the colour that needs no light; `seed` varies the pattern; a box farther away than
    `reach_m` is not drawn.
    """

    x_m: float
    y_m: float
    z_m: float
    yaw_rad: float
    length_m: float
    width_m: float
    height_m: float
    colour: tuple[float, float, float]
    sides_m: float = 0.0
    glow: float = 0.0
    material: Material = Material.PLAIN
    seed: int = 0
    reach_m: float = math.inf


def box_rows(boxes: list[Box]) -> Floats:
    """Return the boxes as a (n, `BOX_COLUMNS`) array."""
    rows = [
        (
            *(box.x_m, box.y_m, box.z_m, cos(box.yaw_rad), sin(box.yaw_rad)),
            *(box.length_m, box.width_m, box.height_m, 0.0, 0.0, box.sides_m, *box.colour),
            *(box.glow, float(box.material), float(box.seed), box.reach_m, -1.0),
        )
        for box in boxes
    ]
    return np.array(rows, np.float64).reshape(len(rows), BOX_COLUMNS)
