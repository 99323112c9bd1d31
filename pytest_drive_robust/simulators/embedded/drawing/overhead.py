"""The classes of the world seen from above, the ego's heading up."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from pytest_drive_robust.domain.truth import ActorKind, LightState, WorldState
from pytest_drive_robust.simulators.embedded.drawing.jit import inner
from pytest_drive_robust.simulators.embedded.drawing.sampling import line_classes
from pytest_drive_robust.simulators.embedded.semantics import SemanticClass

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pytest_drive_robust.simulators.embedded.drawing.view import View

    Floats = NDArray[np.float64]
    Classes = NDArray[np.uint8]

__all__ = ["draw_overhead"]

_KIND, _X, _Y, _YAW, _LENGTH, _WIDTH = (
    WorldState.KIND,
    WorldState.X,
    WorldState.Y,
    WorldState.YAW,
    WorldState.LENGTH,
    WorldState.WIDTH,
)
_DIRT = int(ActorKind.DIRT)
_GREEN, _STOP_SIGN = int(LightState.GREEN), int(LightState.STOP_SIGN)
_BUILDING, _LIGHT, _SIGN = (
    int(SemanticClass.BUILDING),
    int(SemanticClass.TRAFFIC_LIGHT),
    int(SemanticClass.TRAFFIC_SIGN),
)
_STOP_LINE_DEPTH_M = 0.6


@inner
def draw_overhead(
    classes: Classes,
    texels: NDArray[np.uint32],
    levels: Floats,
    level: int,
    view: View,
    texel_m: float,
    ahead_m: float,
    buildings: Floats,
    stop_lines: Floats,
    lights: NDArray[np.int64],
    actors: Floats,
    labels: NDArray[np.int64],
) -> None:
    """Fills `classes` (rows, columns), squares of `texel_m`; its upper edge is `ahead_m` ahead of (view.x_m, view.y_m).

    `view` has a focal length of one pixel and no pitch. `buildings` (b, 6) and `stop_lines` (n, 4: x, y, heading,
    width) are the map's, `lights` (n,) the states of the lines, `labels` the class by kind of actor.
    """
    for row in range(classes.shape[0]):
        line_classes(classes[row], texels, levels, level, view, texel_m, ahead_m - (row + 0.5) * texel_m)
    for k in range(len(stop_lines)):
        if lights[k] != _GREEN:
            line, label = stop_lines[k], _SIGN if lights[k] == _STOP_SIGN else _LIGHT
            _rectangle(classes, line[0], line[1], line[2], _STOP_LINE_DEPTH_M, line[3], label, view, texel_m, ahead_m)
    for k in range(len(buildings)):
        b = buildings[k]
        _rectangle(classes, b[0], b[1], b[2], b[3], b[4], _BUILDING, view, texel_m, ahead_m)
    for flat in (True, False):
        for k in range(len(actors)):
            a = actors[k]
            if (a[_KIND] == _DIRT) == flat:
                label = labels[int(a[_KIND])]
                _rectangle(classes, a[_X], a[_Y], a[_YAW], a[_LENGTH], a[_WIDTH], label, view, texel_m, ahead_m)


@inner
def _rectangle(
    classes: Classes,
    x: float,
    y: float,
    yaw: float,
    length: float,
    width: float,
    label: int,
    view: View,
    texel_m: float,
    ahead_m: float,
) -> None:
    """Fills every square whose middle lies in a rectangle of the world, and the one that holds its centre."""
    rows, columns = classes.shape
    dx, dy = x - view.x_m, y - view.y_m
    ahead, right = dx * view.cos_yaw + dy * view.sin_yaw, dy * view.cos_yaw - dx * view.sin_yaw
    turn = yaw - view.yaw_rad
    c, s = math.cos(turn), math.sin(turn)
    tall, broad = 0.5 * (abs(c) * length + abs(s) * width), 0.5 * (abs(s) * length + abs(c) * width)
    middle = 0.5 * columns * texel_m
    top, bottom = (ahead_m - ahead - tall) / texel_m, (ahead_m - ahead + tall) / texel_m
    left, end = (middle + right - broad) / texel_m, (middle + right + broad) / texel_m
    if bottom < 0.0 or top > rows or end < 0.0 or left > columns:
        return
    for row in range(int(max(top, 0.0)), min(int(bottom) + 1, rows)):
        forward = ahead_m - (row + 0.5) * texel_m - ahead
        for column in range(int(max(left, 0.0)), min(int(end) + 1, columns)):
            aside = (column + 0.5) * texel_m - middle - right
            if abs(forward * c + aside * s) <= 0.5 * length and abs(aside * c - forward * s) <= 0.5 * width:
                classes[row, column] = label
    row, column = math.floor((ahead_m - ahead) / texel_m), math.floor((middle + right) / texel_m)
    if 0 <= row < rows and 0 <= column < columns:
        classes[row, column] = label
