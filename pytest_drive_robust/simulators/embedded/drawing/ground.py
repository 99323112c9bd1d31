"""Draw sky and ground of one camera: for each row of pixels a straight walk over the ground texture.

Our cameras never roll, so a row of pixels meets the ground at one depth and along a straight line. `ground_rows`
computes once the values that depend only on the row. A far row covers many texels in depth and is averaged from several
lines, which keeps stop lines and dashes from flickering.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from pytest_drive_robust.arithmetic import compiled, scalars
from pytest_drive_robust.jit.arrays import Floats
from pytest_drive_robust.jit.kernels import inner
from pytest_drive_robust.simulators.embedded.drawing import texture
from pytest_drive_robust.simulators.embedded.drawing.air import Air
from pytest_drive_robust.simulators.embedded.drawing.canvas import CameraGround, CameraView, Canvas, Headlamps, Triple
from pytest_drive_robust.simulators.embedded.drawing.packed import pack
from pytest_drive_robust.simulators.embedded.drawing.sampling import add_line

DEPTH, AHEAD, LINES, LEVEL, CLEAR, LINE = range(6)
"""The columns of `ground_rows`."""
_MOST_LINES = 4
_COLUMNS = LINE + 2 * _MOST_LINES
_FLATTEST = -1e-4
_SIXTEEN, _THIRTYTWO = np.uint64(16), np.uint64(32)
_LANE = np.uint64(0xFFFF)
_MIRROR = 0.75


def ground_rows(height: int, view: CameraView, haze_per_m: float, levels: Floats) -> Floats:
    """Return (height, 13) values of a camera's rows of pixels, which are equal in every frame.

    `DEPTH` is the distance in metres along the optical axis at which a row meets the ground (0: it shows the sky) and
    `AHEAD` the distance along the ground; `LEVEL` of the texture is sampled on so many `LINES`, whose depth and ground
    distance follow from column `LINE` on; `CLEAR` is the share of the ground's colour that the air lets through.
    """
    rows = np.zeros((height, _COLUMNS))
    for row in range(height):
        up = (0.5 * height - row - 0.5) / view.focal_px
        rise = view.sin_pitch + up * view.cos_pitch
        if rise > _FLATTEST:
            continue
        depth = -view.z_m / rise
        across_m = depth / view.focal_px
        along_m = across_m * depth / view.z_m
        lines = min(int(along_m / across_m / 3.0) + 1, _MOST_LINES)
        footprint = max(across_m, along_m / lines / 2.5) / levels[0, texture.TEXEL_M]
        level = min(math.floor(scalars.log(max(footprint, 1.0)) / scalars.log(2.0) + 0.35), len(levels) - 1)
        lines = min(lines, math.ceil(along_m / (1.5 * levels[level, texture.TEXEL_M])))
        clear = scalars.exp(-haze_per_m * depth)
        rows[row, :LINE] = depth, depth * (view.cos_pitch - up * view.sin_pitch), lines, level, clear
        for line in range(lines):
            up = (0.5 * height - row - (line + 0.5) / lines) / view.focal_px
            line_depth = -view.z_m / min(view.sin_pitch + up * view.cos_pitch, _FLATTEST)
            place = LINE + 2 * line
            rows[row, place : place + 2] = line_depth, line_depth * (view.cos_pitch - up * view.sin_pitch)
    return rows


@inner
def draw_ground(canvas: Canvas, ground: CameraGround, view: CameraView, air: Air, lamps: Headlamps) -> None:
    """Fill `canvas.colours` wherever no face is seen."""
    colours, faces, touched = canvas.colours, canvas.faces, canvas.touched
    rows = ground.rows
    height, width = colours.shape
    for row in range(height):
        if rows[row, DEPTH] <= 0.0:
            colours[row, :] = ground.sky[row]
            continue
        light, haze = _row_light(rows[row], view, air)
        first = 0
        while first < width:
            if faces[row, first] != 0:
                first += 1
                continue
            end = _run_end(faces[row], first, touched[row, 0], touched[row, 1])
            sums = canvas.sums[first:end]
            sums[:] = np.uint64(0)
            for line in range(int(rows[row, LINES])):
                depth, ahead = rows[row, LINE + 2 * line], rows[row, LINE + 2 * line + 1]
                add_line(sums, ground, int(rows[row, LEVEL]), view, depth, ahead, first - 0.5 * width)
            if lamps.strength > 0.0:
                _light_by_night(colours[row, first:end], sums, rows[row], light, haze, view, lamps, first - 0.5 * width)
            else:
                _light_by_day(colours[row, first:end], sums, light, haze)
            first = end


@inner
def _row_light(ground: Floats, view: CameraView, air: Air) -> tuple[Triple, Triple]:
    """Return the factor for the summed samples of a row, and the colour to add: haze and, on wet ground, sky."""
    flat = 1.0 - view.z_m / math.sqrt(ground[AHEAD] * ground[AHEAD] + view.z_m * view.z_m)
    mirrored = _MIRROR * air.mirror * flat * flat * flat * flat
    lit = (air.ambient + air.diffuse * max(air.sun[2], 0.0)) * ground[CLEAR] * (1.0 - mirrored) / ground[LINES]
    lost, mirrored = 1.0 - ground[CLEAR], mirrored * ground[CLEAR]
    light = (np.float32(lit * air.light[0]), np.float32(lit * air.light[1]), np.float32(lit * air.light[2]))
    haze = (
        np.float32(air.haze[0] * lost + air.sheen[0] * mirrored + 0.5),
        np.float32(air.haze[1] * lost + air.sheen[1] * mirrored + 0.5),
        np.float32(air.haze[2] * lost + air.sheen[2] * mirrored + 0.5),
    )
    return light, haze


@inner
def _run_end(faces: NDArray[np.int32], first: int, low: int, high: int) -> int:
    """Return the first column after `first` with a face; there are none outside of `low`..`high`."""
    end = max(first + 1, low)
    while end < high:
        if faces[end] != 0:
            return end
        end += 1
    return len(faces)


@inner
def _light_by_day(colours: NDArray[np.uint32], sums: NDArray[np.uint64], light: Triple, haze: Triple) -> None:
    for u in range(len(colours)):
        colours[u] = _lit(sums[u], light, haze)


@inner
def _lit(total: np.uint64, light: Triple, haze: Triple) -> int:
    """Return the colour of a sum of samples (see `add_line`) in this light, behind haze, packed."""
    red = np.float32(np.int32(total & _LANE)) * light[0] + haze[0]
    green = np.float32(np.int32(total >> _THIRTYTWO)) * light[1] + haze[1]
    blue = np.float32(np.int32((total >> _SIXTEEN) & _LANE)) * light[2] + haze[2]
    return pack(red, green, blue)


@inner
def _light_by_night(
    colours: NDArray[np.uint32],
    sums: NDArray[np.uint64],
    ground: Floats,
    light: Triple,
    haze: Triple,
    view: CameraView,
    lamps: Headlamps,
    start_px: float,
) -> None:
    """Light a run of ground as `_light_by_day` does, and add the ego's headlamps: a cone that widens and fades."""
    # the run in the ego's axes: forward and right are linear in u
    cos_ego, sin_ego = compiled.cos(lamps.yaw_rad), compiled.sin(lamps.yaw_rad)
    step = ground[DEPTH] / view.focal_px
    side = (start_px + 0.5) * step
    dx = view.x_m - lamps.x_m + ground[AHEAD] * view.cos_yaw - side * view.sin_yaw
    dy = view.y_m - lamps.y_m + ground[AHEAD] * view.sin_yaw + side * view.cos_yaw
    forward_0, right_0 = np.float32(cos_ego * dx + sin_ego * dy), np.float32(cos_ego * dy - sin_ego * dx)
    forward_step = np.float32(step * (sin_ego * view.cos_yaw - cos_ego * view.sin_yaw))
    right_step = np.float32(step * (cos_ego * view.cos_yaw + sin_ego * view.sin_yaw))
    strength, blue_share = np.float32(lamps.strength * ground[CLEAR] / ground[LINES]), np.float32(0.9)
    none, whole, two, fade = np.float32(0.0), np.float32(1.0), np.float32(2.0), np.float32(1.0 / 22.0)
    base, widen, steep, rise = np.float32(1.6), np.float32(0.35), np.float32(1.6), np.float32(0.25)
    for u in range(len(colours)):
        forward, right = forward_0 + np.float32(u) * forward_step, right_0 + np.float32(u) * right_step
        right = right if right > none else -right
        forward = forward if forward > two else two
        beam = (whole - right / (base + widen * forward)) * steep
        beam = beam if beam > none else none
        beam = beam if beam < whole else whole
        near = (forward - two) * rise
        near = near if near < whole else whole
        extra = strength * beam * near / (whole + forward * fade * (forward * fade))
        colours[u] = _lit(sums[u], (light[0] + extra, light[1] + extra, light[2] + extra * blue_share), haze)
