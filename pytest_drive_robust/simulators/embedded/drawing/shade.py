"""Colour the faces that `raster.py` has found: light each face once, colour each pixel once."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from pytest_drive_robust.arithmetic.compiled import cos, sin
from pytest_drive_robust.jit.arrays import Floats, Packed
from pytest_drive_robust.jit.kernels import inner
from pytest_drive_robust.simulators.embedded.drawing import boxes as box
from pytest_drive_robust.simulators.embedded.drawing import canvas as face
from pytest_drive_robust.simulators.embedded.drawing.air import Air
from pytest_drive_robust.simulators.embedded.drawing.canvas import CameraView, Canvas, Headlamps, Triple
from pytest_drive_robust.simulators.embedded.drawing.patterns import (
    FLOOR_M,
    SILL_M,
    WINDOW_HIGH,
    facade,
    plain,
    ribs,
    stripes,
)

Lens = tuple[float, float, float, float, float, float, float]

CLEAR_STEPS_PER_M = 4
"""Entries per metre of depth in `clear`, the table of the share of light that the air lets through."""

_STRIPES, _RIBS = int(box.Material.STRIPES), int(box.Material.RIBS)
_SIDES = 4
_SEGMENT_PX = 64
_PER_FLOOR = 1.0 / FLOOR_M
_ONE_COLOUR = 1.0 / 160.0
_LAMP_THROUGH_HAZE = 0.35
_WINDOW, _LIT_WINDOW = (52.0, 66.0, 84.0), (250.0, 205.0, 120.0)
_GRAZING = 0.05


@inner
def draw_pixels(
    canvas: Canvas, rows: Floats, view: CameraView, air: Air, lamps: Headlamps, clear: NDArray[np.float32]
) -> None:
    """Fill `canvas.colours` wherever a face is seen.

    `rows` are the boxes, `clear` (n,) is the share of a surface's colour that survives the air, by `CLEAR_STEPS_PER_M`
    steps of depth.
    """
    colours, faces, nearness = canvas.colours, canvas.faces, canvas.nearness
    touched, table = canvas.touched, canvas.table
    height, width = colours.shape
    middle_u, middle_v = 0.5 * width - 0.5, 0.5 * height - 0.5
    lens = (middle_u, middle_v, view.focal_px, 1.0 / view.focal_px, view.cos_pitch, view.sin_pitch, view.z_m)
    for row in range(height):
        column, end = touched[row, 0], touched[row, 1]
        while column < end:
            number, first = faces[row, column], column
            column += 1
            while column < end and faces[row, column] == number:
                column += 1
            if number == 0:
                continue
            if table[number, face.PACKED] == face.UNLIT:
                _light_face(table[number], rows[int(table[number, face.BOX])], view, air, lamps, clear)
            packed = int(table[number, face.PACKED])
            if packed >= 0:
                for at in range(first, column):
                    colours[row, at] = packed
                continue
            b = rows[int(table[number, face.BOX])]
            while first < column:
                last = min(first + _SEGMENT_PX, column)
                _draw_run(
                    colours[row, first:last], nearness[row, first:last], row, first, table[number], b, lens, air, clear
                )
                first = last


@inner
def _light_face(
    entry: Floats, b: Floats, view: CameraView, air: Air, lamps: Headlamps, clear: NDArray[np.float32]
) -> None:
    """Fill in the columns of a row of the table from PACKED on."""
    side, material = int(entry[face.SIDE]), b[box.MATERIAL]
    x, y, z = _outward(b, side)
    shade, extra = _shade(x, y, z, b, air, lamps)
    glow = b[box.GLOW]
    entry[face.GLOW], entry[face.LIGHT], entry[face.EXTRA] = glow, shade, extra
    for channel in range(3):
        light = shade * air.light[channel] + extra
        entry[face.RED + channel] = b[box.RED + channel] * (glow + (1.0 - glow) * light)
    entry[face.PATTERN] = material if side < _SIDES else 0.0
    entry[face.PACKED] = -1.0
    if entry[face.PATTERN] != 0.0:
        _lay_out(entry, b, (x, y, z), side, view)
        return
    nearest = _clear(1.0 / entry[face.NEAREST], clear, glow)
    farthest = _clear(1.0 / entry[face.FARTHEST], clear, glow)
    if nearest - farthest < _ONE_COLOUR:
        left = 0.5 * (nearest + farthest)
        packed = 0
        for channel in range(3):
            value = min(entry[face.RED + channel] * left + air.haze[channel] * (1.0 - left) + 0.5, 255.0)
            packed |= int(value) << (8 * channel)
        entry[face.PACKED] = packed


@inner
def _outward(b: Floats, side: int) -> Triple:
    """Return the normal of a face in world axes; drawn-in tops lean the sides back."""
    if side >= _SIDES:
        return 0.0, 0.0, 1.0 if side == _SIDES else -1.0
    if side == 0 or side == 2:
        lean, ahead, right = (b[box.FRONT], 1.0, 0.0) if side == 0 else (b[box.REAR], -1.0, 0.0)
    else:
        lean, ahead, right = b[box.SIDES], 0.0, 1.0 if side == 1 else -1.0
    size = math.sqrt(b[box.HIGH] * b[box.HIGH] + lean * lean)
    level = b[box.HIGH] / size
    x, y = ahead * b[box.COS] - right * b[box.SIN], ahead * b[box.SIN] + right * b[box.COS]
    return x * level, y * level, lean / size


@inner
def _lay_out(entry: Floats, b: Floats, normal: Triple, side: int, view: CameraView) -> None:
    """Compute the columns that map a place in the picture to metres along a patterned face."""
    half_length, half_width = 0.5 * b[box.ALONG], 0.5 * b[box.WIDE]
    # the face's first corner and the way to its second, in the box's axes
    if side == 0:
        ahead, right, along_ahead, along_right = half_length, -half_width, 0.0, 1.0
    elif side == 1:
        ahead, right, along_ahead, along_right = half_length, half_width, -1.0, 0.0
    elif side == 2:
        ahead, right, along_ahead, along_right = -half_length, half_width, 0.0, -1.0
    else:
        ahead, right, along_ahead, along_right = -half_length, -half_width, 1.0, 0.0
    dx = view.x_m - b[box.X] - ahead * b[box.COS] + right * b[box.SIN]
    dy = view.y_m - b[box.Y] - ahead * b[box.SIN] - right * b[box.COS]
    x, y = along_ahead * b[box.COS] - along_right * b[box.SIN], along_ahead * b[box.SIN] + along_right * b[box.COS]
    level = x * view.cos_yaw + y * view.sin_yaw
    entry[face.ALONG_RIGHT] = y * view.cos_yaw - x * view.sin_yaw
    entry[face.ALONG_UP], entry[face.ALONG_FORWARD] = -level * view.sin_pitch, level * view.cos_pitch
    entry[face.START_M] = dx * x + dy * y
    entry[face.DISTANCE_M] = abs(dx * normal[0] + dy * normal[1] + (view.z_m - b[box.Z]) * normal[2])


@inner
def _clear(depth_m: float, clear: NDArray[np.float32], glow: float) -> float:
    """Return the share of light that the air lets through over `depth_m`; more for a lamp (`glow`)."""
    steps = min(CLEAR_STEPS_PER_M * depth_m, float(len(clear) - 1))
    left = float(clear[int(steps)])
    return left + (1.0 - left) * _LAMP_THROUGH_HAZE * glow


@inner
def _shade(x: float, y: float, z: float, b: Floats, air: Air, lamps: Headlamps) -> tuple[float, float]:
    """Return the light of sun, sky and the ego's headlamps on a face whose normal is (x, y, z)."""
    sun = x * air.sun[0] + y * air.sun[1] + z * air.sun[2]
    shade = air.ambient * (0.86 + 0.14 * z) + air.diffuse * max(sun, 0.0)
    if lamps.strength <= 0.0:
        return shade, 0.0
    dx, dy = b[box.X] - lamps.x_m, b[box.Y] - lamps.y_m
    c, s = cos(lamps.yaw_rad), sin(lamps.yaw_rad)
    forward, right = c * dx + s * dy, c * dy - s * dx
    beam = 1.0 - abs(right) / (2.6 + 0.4 * max(forward, 0.0))
    if forward < 1.0 or beam <= 0.0 or b[box.Z] > 2.5:
        return shade, 0.0
    facing = max(-(x * c + y * s), 0.15)
    return shade, lamps.strength * min(beam * 1.6, 1.0) * facing / (1.0 + forward / 24.0 * (forward / 24.0))


@inner
def _draw_run(
    colours: Packed,
    nearness: NDArray[np.float32],
    row: int,
    first: int,
    entry: Floats,
    b: Floats,
    lens: Lens,
    air: Air,
    clear: NDArray[np.float32],
) -> None:
    """Colour one run of pixels of one face; the air's share is interpolated between the ends of the run."""
    glow, last = entry[face.GLOW], len(colours) - 1
    near_start, near_end = float(nearness[0]), float(nearness[last])
    depth_start, depth_end = 1.0 / near_start, 1.0 / near_end
    left = _clear(depth_start, clear, glow)
    change = (_clear(depth_end, clear, glow) - left) / max(last, 1)
    through = (np.float32(left), np.float32(change))
    own = (np.float32(entry[face.RED]), np.float32(entry[face.GREEN]), np.float32(entry[face.BLUE]))
    haze = (np.float32(air.haze[0]), np.float32(air.haze[1]), np.float32(air.haze[2]))
    pattern = int(entry[face.PATTERN])
    if pattern == 0:
        plain(colours, own, haze, through)
        return
    middle_u, middle_v, focal_px, per_focal, cos_pitch, sin_pitch, eye_m = lens
    right, up = (first - middle_u) * per_focal, (middle_v - row) * per_focal
    # metres along the face = (across + across_step * u) / near + start, up from the box's bottom = climb / near + rise
    across = right * entry[face.ALONG_RIGHT] + up * entry[face.ALONG_UP] + entry[face.ALONG_FORWARD]
    across_step, start = entry[face.ALONG_RIGHT] * per_focal, entry[face.START_M]
    climb, rise = up * cos_pitch + sin_pitch, eye_m - b[box.Z]
    near = 0.5 * (near_start + near_end)
    pixels_per_m = max(entry[face.DISTANCE_M] * near, _GRAZING) * near * focal_px
    place = (np.float32(across), np.float32(across_step), np.float32(start), np.float32(climb), np.float32(rise))
    if pattern == _STRIPES:
        white = _lit(entry, air, (240.0, 240.0, 236.0))
        stripes(colours, nearness, place, np.float32(pixels_per_m), own, white, haze, through)
    elif pattern == _RIBS:
        ribs(colours, nearness, place, np.float32(pixels_per_m), own, haze, through)
    elif _between_floors(climb * depth_start + rise, climb * depth_end + rise, pixels_per_m):
        plain(colours, own, haze, through)
    else:
        window, shining = _lit(entry, air, _WINDOW), _lit_window(entry, air)
        seed, night = np.int32(b[box.SEED]), np.float32(air.night)
        facade(colours, nearness, place, np.float32(pixels_per_m), own, window, shining, haze, through, seed, night)


@inner
def _between_floors(up_m: float, other_m: float, pixels_per_m: float) -> bool:
    """Return whether a run of pixels from height `up_m` to `other_m` meets no window."""
    phase, other = (up_m - SILL_M) * _PER_FLOOR, (other_m - SILL_M) * _PER_FLOOR
    floor, edge = math.floor(phase), 0.5 / max(FLOOR_M * pixels_per_m, 1e-6)
    phase, other = phase - floor, other - floor
    return min(phase, other) > WINDOW_HIGH + edge and max(phase, other) < 1.0 - edge


@inner
def _lit(entry: Floats, air: Air, colour: Triple) -> Triple:
    """Return another colour in the light of a face."""
    shade, extra = entry[face.LIGHT], entry[face.EXTRA]
    return (
        np.float32(colour[0] * (shade * air.light[0] + extra)),
        np.float32(colour[1] * (shade * air.light[1] + extra)),
        np.float32(colour[2] * (shade * air.light[2] + extra)),
    )


@inner
def _lit_window(entry: Floats, air: Air) -> Triple:
    dark, shining = _lit(entry, air, _LIT_WINDOW), _LIT_WINDOW
    return (
        np.float32(0.75 * shining[0] + 0.25 * dark[0]),
        np.float32(0.75 * shining[1] + 0.25 * dark[1]),
        np.float32(0.75 * shining[2] + 0.25 * dark[2]),
    )
