"""Draw the shadows of actors on the ground: below each actor, and away from the sun."""

from __future__ import annotations

import math

import numpy as np

from pytest_drive_robust.arithmetic.compiled import cos, sin
from pytest_drive_robust.domain.truth import ActorKind, WorldState
from pytest_drive_robust.jit.arrays import Floats
from pytest_drive_robust.jit.kernels import inner
from pytest_drive_robust.simulators.embedded.drawing.air import Air
from pytest_drive_robust.simulators.embedded.drawing.canvas import CameraView, Canvas
from pytest_drive_robust.simulators.embedded.drawing.ground import AHEAD, CLEAR, DEPTH

_KIND, _X, _Y, _YAW = WorldState.KIND, WorldState.X, WorldState.Y, WorldState.YAW
_LENGTH, _WIDTH, _HEIGHT = WorldState.LENGTH, WorldState.WIDTH, WorldState.HEIGHT
_BUILDING, _DIRT = int(ActorKind.BUILDING), int(ActorKind.DIRT)
_MARGIN_M = 0.12
_CAST_HEIGHT = 0.85


@inner
def draw_shadows(canvas: Canvas, rows: Floats, actors: Floats, view: CameraView, air: Air) -> None:
    """Darken the ground below `actors` (k, 10) and, while the sun shines, where their shadow falls."""
    for k in range(len(actors)):
        if actors[k, _KIND] != _BUILDING and actors[k, _KIND] != _DIRT:
            _shadow(canvas, rows, actors[k], view, air)


@inner
def _shadow(canvas: Canvas, rows: Floats, actor: Floats, view: CameraView, air: Air) -> None:
    """Darken the ground that an actor's slightly enlarged outline sweeps over along the direction of sunlight."""
    colours, faces = canvas.colours, canvas.faces
    height, width = colours.shape
    c, s = cos(actor[_YAW]), sin(actor[_YAW])
    long, wide = 0.5 * actor[_LENGTH] + _MARGIN_M, 0.5 * actor[_WIDTH] + _MARGIN_M
    # the actor's middle, axis and sweep in the camera's level axes
    dx, dy = actor[_X] - view.x_m, actor[_Y] - view.y_m
    ahead, aside = dx * view.cos_yaw + dy * view.sin_yaw, dy * view.cos_yaw - dx * view.sin_yaw
    cos_turn, sin_turn = c * view.cos_yaw + s * view.sin_yaw, s * view.cos_yaw - c * view.sin_yaw
    east, south = _CAST_HEIGHT * actor[_HEIGHT] * air.cast[0], _CAST_HEIGHT * actor[_HEIGHT] * air.cast[1]
    sweep_ahead, sweep_aside = east * view.cos_yaw + south * view.sin_yaw, south * view.cos_yaw - east * view.sin_yaw
    # the sweep in the actor's axes
    along, across = sweep_ahead * cos_turn + sweep_aside * sin_turn, sweep_aside * cos_turn - sweep_ahead * sin_turn
    reach = abs(cos_turn) * long + abs(sin_turn) * wide
    first = row_of(ahead + reach + max(sweep_ahead, 0.0), view, height)
    last = row_of(ahead - reach + min(sweep_ahead, 0.0), view, height)
    swept = math.sqrt(along * along + across * across)
    for row in range(first, last + 1):
        if rows[row, DEPTH] <= 0.0:
            continue
        forward = rows[row, AHEAD] - ahead
        # along the row: length axis = forward * cos + side * sin, width axis = side * cos - forward * sin
        low, high = _slab(forward * cos_turn, sin_turn, min(along, 0.0) - long, max(along, 0.0) + long, -1e9, 1e9)
        low, high = _slab(-forward * sin_turn, cos_turn, min(across, 0.0) - wide, max(across, 0.0) + wide, low, high)
        if swept > 0.01:
            # clip to the band between the two lines along the sweep that touch the outline
            half = (abs(across) * long + abs(along) * wide) / swept
            start, slope = -forward * sweep_aside / swept, sweep_ahead / swept
            low, high = _slab(start, slope, -half, half, low, high)
        scale = view.focal_px / rows[row, DEPTH]
        left, right = 0.5 * width + (aside + low) * scale, 0.5 * width + (aside + high) * scale
        share = np.uint32(256.0 * (1.0 - (1.0 - air.shadow) * rows[row, CLEAR]))
        for column in range(int(max(left, 0.0) + 0.5), int(min(max(right, 0.0), float(width)) + 0.5)):
            if faces[row, column] == 0:
                colour = colours[row, column]
                red_blue = ((colour & np.uint32(0xFF00FF)) * share >> np.uint32(8)) & np.uint32(0xFF00FF)
                green = ((colour & np.uint32(0x00FF00)) * share >> np.uint32(8)) & np.uint32(0x00FF00)
                colours[row, column] = red_blue | green


@inner
def row_of(ahead_m: float, view: CameraView, height: int) -> int:
    """Return the row of pixels that shows the ground `ahead_m` ahead, limited to the picture."""
    forward = ahead_m * view.cos_pitch - view.z_m * view.sin_pitch
    if forward < 0.01:
        return height - 1
    up = -view.z_m * view.cos_pitch - ahead_m * view.sin_pitch
    return int(min(max(0.5 * height - view.focal_px * up / forward, 0.0), height - 1.0))


@inner
def _slab(start: float, slope: float, lowest: float, highest: float, low: float, high: float) -> tuple[float, float]:
    """Return the part of `low`..`high` where lowest <= start + slope * x <= highest (low > high: none)."""
    if abs(slope) < 1e-9:
        return (low, high) if lowest <= start <= highest else (1.0, -1.0)
    one, other = (lowest - start) / slope, (highest - start) / slope
    return max(low, min(one, other)), min(high, max(one, other))
