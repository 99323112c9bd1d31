"""Draws boxes and ground shadows into one camera, exact in depth.

Faces are clipped at the near plane in camera coordinates (right, up, forward), projected, and filled row by row; the
inverse depth of a plane is linear in the picture, so that the depth test is exact in every pixel.

All of it stays in one file on purpose: numba's cache notices changes of the file of a kernel only, not of its helpers'.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numba import njit

from pytest_drive_robust.domain.truth import ActorKind, Frame
from pytest_drive_robust.simulators.embedded.drawing import boxes as box

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pytest_drive_robust.simulators.embedded.drawing.air import Air
    from pytest_drive_robust.simulators.embedded.drawing.view import Headlamps, View

    Floats = NDArray[np.float64]
    Triple = tuple[float, float, float]
    Surface = tuple[float, float, float, float, float, float, float, float]

__all__ = ["CORNERS", "draw_boxes", "draw_shadows"]

_NEAR_M = 0.1
_STRIPES, _RIBS = int(box.Material.STRIPES), int(box.Material.RIBS)
_KIND, _X, _Y, _YAW, _LENGTH, _WIDTH = Frame.KIND, Frame.X, Frame.Y, Frame.YAW, Frame.LENGTH, Frame.WIDTH
_BUILDING = int(ActorKind.BUILDING)
_BOTTOM = 5
_SHADOW_MARGIN_M = 0.12
_FLOOR_M, _BAY_M = 3.1, 3.2

CORNERS = np.array(((0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7), (4, 5, 6, 7), (0, 1, 2, 3)), np.int64)
"""The corners of the front, right, rear, left, top and bottom face of a box (see `_corners`)."""


@njit(cache=True, error_model="numpy")
def draw_boxes(
    image: NDArray[np.uint8],
    depth: NDArray[np.float32],
    rows: Floats,
    first: int,
    count: int,
    view: View,
    air: Air,
    lamps: Headlamps,
    clear: Floats,
) -> None:
    """Draws the first `count` of `rows` into `image` (height, width, 3), row `first` first and those before it last.

    Actors before furniture: what they hide of buildings is then never shaded. (Sorting all boxes by distance costs more
    than it saves, and lets touching faces of one actor swap with the pose.)
    `depth` (height, width) is scratch: the inverse depth in 1/m of what is seen, 0 where no box is. `clear` is the
    share of a surface's colour that survives the air, by whole metres of depth.
    """
    depth[:] = 0.0
    corners, clipped = np.empty((8, 3)), np.empty((8, 3))
    for step in range(count):
        b = rows[(first + step) % count]
        if not _may_be_seen(b, view, image.shape[1], image.shape[0]):
            continue
        middle = _corners(corners, b, view)
        for face in range(6):
            _draw_face(image, depth, corners, middle, clipped, face, b, view, air, lamps, clear)


@njit(cache=True, error_model="numpy")
def _may_be_seen(b: Floats, view: View, width: int, height: int) -> bool:
    """False when the sphere around the box is behind the camera, beside the picture or beyond the box's reach."""
    grow = max(-b[box.FRONT], 0.0) + max(-b[box.REAR], 0.0) + 2.0 * max(-b[box.SIDES], 0.0)
    radius = 0.5 * math.sqrt((b[box.ALONG] + grow) ** 2 + (b[box.WIDE] + grow) ** 2 + b[box.HIGH] ** 2)
    right, up, forward = _to_camera(b[box.X], b[box.Y], b[box.Z] + 0.5 * b[box.HIGH], view)
    if forward + radius < _NEAR_M or forward > b[box.REACH]:
        return False
    half = 0.5 * width / view.focal_px
    if abs(right) - half * forward > radius * math.sqrt(1.0 + half * half):
        return False
    half = 0.5 * height / view.focal_px
    return abs(up) - half * forward <= radius * math.sqrt(1.0 + half * half)


@njit(cache=True, error_model="numpy")
def _to_camera(x: float, y: float, z: float, view: View) -> tuple[float, float, float]:
    dx, dy, dz = x - view.x_m, y - view.y_m, z - view.z_m
    cos_yaw, sin_yaw = view.cos_yaw, view.sin_yaw
    cos_pitch, sin_pitch = view.cos_pitch, view.sin_pitch
    ahead = dx * cos_yaw + dy * sin_yaw
    return dy * cos_yaw - dx * sin_yaw, dz * cos_pitch - ahead * sin_pitch, ahead * cos_pitch + dz * sin_pitch


@njit(cache=True, error_model="numpy")
def _corners(corners: Floats, b: Floats, view: View) -> Triple:
    """Camera coordinates of front left, front right, rear right, rear left at the bottom, then the same at the top.

    Returns their mean.
    """
    c, s = math.cos(b[box.YAW]), math.sin(b[box.YAW])
    mean_right, mean_up, mean_forward = 0.0, 0.0, 0.0
    for corner in range(8):
        top = 1.0 if corner >= 4 else 0.0
        place = corner % 4
        ahead = 0.5 * b[box.ALONG] - top * b[box.FRONT] if place < 2 else -0.5 * b[box.ALONG] + top * b[box.REAR]
        aside = 0.5 * b[box.WIDE] - top * b[box.SIDES]
        if place == 0 or place == 3:
            aside = -aside
        x, y = b[box.X] + c * ahead - s * aside, b[box.Y] + s * ahead + c * aside
        right, up, forward = _to_camera(x, y, b[box.Z] + top * b[box.HIGH], view)
        corners[corner, 0], corners[corner, 1], corners[corner, 2] = right, up, forward
        mean_right, mean_up, mean_forward = mean_right + right, mean_up + up, mean_forward + forward
    return mean_right / 8.0, mean_up / 8.0, mean_forward / 8.0


@njit(cache=True, error_model="numpy")
def _draw_face(
    image: NDArray[np.uint8],
    depth: NDArray[np.float32],
    corners: Floats,
    middle: Triple,
    clipped: Floats,
    face: int,
    b: Floats,
    view: View,
    air: Air,
    lamps: Headlamps,
    clear: Floats,
) -> None:
    first, second, third, fourth = CORNERS[face, 0], CORNERS[face, 1], CORNERS[face, 2], CORNERS[face, 3]
    px, py, pz = corners[first, 0], corners[first, 1], corners[first, 2]
    # the diagonals span the plane, also where an edge has shrunk to nothing
    ax, ay, az = corners[third, 0] - px, corners[third, 1] - py, corners[third, 2] - pz
    bx, by, bz = (
        corners[fourth, 0] - corners[second, 0],
        corners[fourth, 1] - corners[second, 1],
        corners[fourth, 2] - corners[second, 2],
    )
    nx, ny, nz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    size = math.sqrt(nx * nx + ny * ny + nz * nz)
    if size < 1e-9:
        return
    if nx * (px - middle[0]) + ny * (py - middle[1]) + nz * (pz - middle[2]) < 0.0:
        size = -size
    nx, ny, nz = nx / size, ny / size, nz / size
    distance = nx * px + ny * py + nz * pz
    if distance > -1e-6:
        return
    count = _clip_and_project(corners, face, clipped, view, image.shape[1], image.shape[0])
    if count < 3:
        return
    shade, extra = _shade(nx, ny, nz, b, view, air, lamps)
    focal = view.focal_px
    plane = (nx / (focal * distance), -ny / (focal * distance), 0.0)
    offset = nz / distance - plane[0] * image.shape[1] / 2.0 - plane[1] * image.shape[0] / 2.0
    surface = _surface(corners, first, second, distance, b, face, view, image.shape[1], image.shape[0])
    away = math.sqrt(px * px + py * py + pz * pz)
    keep = face < 4 and -distance > 0.4 * away
    _fill(image, depth, clipped, count, (plane[0], plane[1], offset), b, shade, extra, surface, view, air, clear, keep)


@njit(cache=True, error_model="numpy")
def _shade(nx: float, ny: float, nz: float, b: Floats, view: View, air: Air, lamps: Headlamps) -> tuple[float, float]:
    """Sun and sky on a face whose normal in camera coordinates is (nx, ny, nz), and the ego's headlamps on it."""
    cos_yaw, sin_yaw = view.cos_yaw, view.sin_yaw
    cos_pitch, sin_pitch = view.cos_pitch, view.sin_pitch
    ahead, world_z = nz * cos_pitch - ny * sin_pitch, nz * sin_pitch + ny * cos_pitch
    world_x, world_y = ahead * cos_yaw - nx * sin_yaw, ahead * sin_yaw + nx * cos_yaw
    sun = world_x * air.sun[0] + world_y * air.sun[1] + world_z * air.sun[2]
    shade = air.ambient * (0.86 + 0.14 * world_z) + air.diffuse * max(sun, 0.0)
    if lamps.strength <= 0.0:
        return shade, 0.0
    dx, dy = b[box.X] - lamps.x_m, b[box.Y] - lamps.y_m
    c, s = math.cos(lamps.yaw_rad), math.sin(lamps.yaw_rad)
    forward, right = c * dx + s * dy, c * dy - s * dx
    beam = 1.0 - abs(right) / (2.6 + 0.4 * max(forward, 0.0))
    if forward < 1.0 or beam <= 0.0 or b[box.Z] > 2.5:
        return shade, 0.0
    facing = max(-(world_x * c + world_y * s), 0.15)
    return shade, lamps.strength * min(beam * 1.6, 1.0) * facing / (1.0 + (forward / 24.0) ** 2)


@njit(cache=True, error_model="numpy")
def _clip_and_project(corners: Floats, face: int, clipped: Floats, view: View, width: int, height: int) -> int:
    """Cuts a face (camera coordinates) at the near plane; `clipped` gets u, v, 1/depth of its corners. Their number."""
    count = 0
    for place in range(4):
        here, there = CORNERS[face, place], CORNERS[face, (place + 1) % 4]
        z, next_z = corners[here, 2], corners[there, 2]
        if z >= _NEAR_M:
            clipped[count, 0], clipped[count, 1], clipped[count, 2] = corners[here, 0], corners[here, 1], z
            count += 1
        if (z >= _NEAR_M) != (next_z >= _NEAR_M):
            share = (_NEAR_M - z) / (next_z - z)
            for axis in range(2):
                clipped[count, axis] = corners[here, axis] + share * (corners[there, axis] - corners[here, axis])
            clipped[count, 2] = _NEAR_M
            count += 1
    for corner in range(count):
        inverse = 1.0 / clipped[corner, 2]
        clipped[corner, 0] = width / 2.0 + view.focal_px * clipped[corner, 0] * inverse
        clipped[corner, 1] = height / 2.0 - view.focal_px * clipped[corner, 1] * inverse
        clipped[corner, 2] = inverse
    return count


@njit(cache=True, error_model="numpy")
def _span(corners: Floats, count: int, v: float) -> tuple[float, float]:
    """Where a convex polygon meets the horizontal line `v`: lowest and highest u (low > high: nowhere)."""
    low, high = 1e30, -1e30
    for corner in range(count):
        u0, v0 = corners[corner, 0], corners[corner, 1]
        after = corner + 1 if corner + 1 < count else 0
        u1, v1 = corners[after, 0], corners[after, 1]
        if (v0 <= v) != (v1 <= v):
            u = u0 + (v - v0) / (v1 - v0) * (u1 - u0)
            low, high = min(low, u), max(high, u)
    return low, high


@njit(cache=True, error_model="numpy")
def _bounds(corners: Floats, count: int, column: int) -> tuple[float, float]:
    low, high = 1e30, -1e30
    for corner in range(count):
        low, high = min(low, corners[corner, column]), max(high, corners[corner, column])
    return low, high


@njit(cache=True, error_model="numpy")
def _pixels(low: float, high: float, size: int, keep: bool) -> tuple[int, int]:
    """First and last pixel whose centre lies in low..high; where that is none and `keep`, the one in the middle."""
    first, last = math.ceil(low - 0.5), math.floor(high - 0.5)
    if last < first and keep:
        first = last = math.floor((low + high) / 2.0)
    return int(max(first, 0.0)), int(min(last, size - 1.0))


@njit(cache=True, error_model="numpy")
def _fill(
    image: NDArray[np.uint8],
    depth: NDArray[np.float32],
    corners: Floats,
    count: int,
    plane: tuple[float, float, float],
    b: Floats,
    shade: float,
    extra: float,
    surface: Surface,
    view: View,
    air: Air,
    clear: Floats,
    keep: bool,
) -> None:
    """Fills a projected face. With `keep` it has at least one pixel a row: poles do not break up far away."""
    height, width = image.shape[0], image.shape[1]
    v_low, v_high = _bounds(corners, count, 1)
    u_low, u_high = _bounds(corners, count, 0)
    if v_high < 0.0 or v_low > height or u_high < 0.0 or u_low > width:
        return
    farthest, nearest = _bounds(corners, count, 2)
    glow = b[box.GLOW]
    light = (shade * air.light[0] + extra, shade * air.light[1] + extra, shade * air.light[2] + extra)
    colour = (
        b[box.RED] * (glow + (1.0 - glow) * light[0]),
        b[box.GREEN] * (glow + (1.0 - glow) * light[1]),
        b[box.BLUE] * (glow + (1.0 - glow) * light[2]),
    )
    patterned = surface[7] > 0.0
    first_row, last_row = _pixels(v_low, v_high, height, keep)
    for row in range(first_row, last_row + 1):
        v = row + 0.5
        low, high = _span(corners, count, v)
        if low > high:
            low, high = u_low, u_high
        if high < 0.0 or low > width:
            continue
        first, last = _pixels(low, high, width, keep)
        across = (plane[0], plane[1] * v + plane[2])
        if patterned:
            _patterned_row(
                image, depth, row, first, last, across, (farthest, nearest), b, light, surface, view, air, clear
            )
        else:
            _plain_row(image, depth, row, first, last, across, (farthest, nearest), colour, glow, air.haze, clear)


@njit(cache=True, error_model="numpy")
def _plain_row(
    image: NDArray[np.uint8],
    depth: NDArray[np.float32],
    row: int,
    first: int,
    last: int,
    across: tuple[float, float],
    limits: tuple[float, float],
    colour: Triple,
    glow: float,
    haze: Triple,
    clear: Floats,
) -> None:
    """Fills columns `first` to `last` of a row with a lit `colour`; inverse depth is across[0] * u + across[1]."""
    farthest = len(clear) - 1
    for column in range(first, last + 1):
        inverse = min(max(across[0] * (column + 0.5) + across[1], limits[0]), limits[1])
        if inverse <= depth[row, column]:
            continue
        depth[row, column] = inverse
        left = clear[min(int(1.0 / inverse), farthest)]
        # a lamp is seen farther through haze than what it does not light
        left += (1.0 - left) * 0.35 * glow
        lost = 1.0 - left
        image[row, column, 0] = np.uint8(min(colour[0] * left + haze[0] * lost + 0.5, 255.0))
        image[row, column, 1] = np.uint8(min(colour[1] * left + haze[1] * lost + 0.5, 255.0))
        image[row, column, 2] = np.uint8(min(colour[2] * left + haze[2] * lost + 0.5, 255.0))


@njit(cache=True, error_model="numpy")
def _patterned_row(
    image: NDArray[np.uint8],
    depth: NDArray[np.float32],
    row: int,
    first: int,
    last: int,
    across: tuple[float, float],
    limits: tuple[float, float],
    b: Floats,
    light: Triple,
    surface: Surface,
    view: View,
    air: Air,
    clear: Floats,
) -> None:
    """As `_plain_row`, for a box with a pattern: `light` is what its colours are multiplied with."""
    farthest, material, seed = len(clear) - 1, int(b[box.MATERIAL]), int(b[box.SEED])
    own = (b[box.RED], b[box.GREEN], b[box.BLUE])
    v, haze, night, focal = row + 0.5, air.haze, air.night, view.focal_px
    for column in range(first, last + 1):
        inverse = min(max(across[0] * (column + 0.5) + across[1], limits[0]), limits[1])
        if inverse <= depth[row, column]:
            continue
        depth[row, column] = inverse
        depth_m = 1.0 / inverse
        (red, green, blue), glow = _pattern(material, seed, own, surface, column + 0.5, v, depth_m, focal, night)
        left = clear[min(int(depth_m), farthest)]
        left += (1.0 - left) * 0.35 * glow
        lost, plain, glow = 1.0 - left, (1.0 - glow) * left, glow * left
        image[row, column, 0] = np.uint8(min(red * (glow + plain * light[0]) + haze[0] * lost + 0.5, 255.0))
        image[row, column, 1] = np.uint8(min(green * (glow + plain * light[1]) + haze[1] * lost + 0.5, 255.0))
        image[row, column, 2] = np.uint8(min(blue * (glow + plain * light[2]) + haze[2] * lost + 0.5, 255.0))


@njit(cache=True, error_model="numpy")
def _surface(
    corners: Floats,
    first: int,
    second: int,
    distance: float,
    b: Floats,
    face: int,
    view: View,
    width: int,
    height: int,
) -> Surface:
    """How a place in the picture maps to metres along the face (from its first corner on) and up from the box's bottom.

    along = (s0 * u + s1 * v + s2) / inverse depth - s3, up = (s4 * v + s5) / inverse depth + s6; s7 is the distance of
    the camera to the face's plane, 0 for faces without a pattern.
    """
    if b[box.MATERIAL] == 0.0 or face > 3:
        return (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    px, py, pz = corners[first, 0], corners[first, 1], corners[first, 2]
    ax, ay, az = corners[second, 0] - px, corners[second, 1] - py, corners[second, 2] - pz
    size = max(math.sqrt(ax * ax + ay * ay + az * az), 1e-6)
    ax, ay, az = ax / size, ay / size, az / size
    focal = view.focal_px
    cos_pitch, sin_pitch = view.cos_pitch, view.sin_pitch
    return (
        ax / focal,
        -ay / focal,
        az - ax * width / 2.0 / focal + ay * height / 2.0 / focal,
        px * ax + py * ay + pz * az,
        -cos_pitch / focal,
        sin_pitch + cos_pitch * height / 2.0 / focal,
        view.z_m - b[box.Z],
        -distance,
    )


@njit(cache=True, error_model="numpy")
def _pattern(
    material: int,
    seed: int,
    own: Triple,
    surface: Surface,
    u: float,
    v: float,
    depth_m: float,
    focal: float,
    night: float,
) -> tuple[Triple, float]:
    """Colour and glow of a place on a patterned face; a pattern that is too fine for the pixel fades to its mean."""
    along = (surface[0] * u + surface[1] * v + surface[2]) * depth_m - surface[3]
    up = (surface[4] * v + surface[5]) * depth_m + surface[6]
    pixels_per_m = focal * max(surface[7], 0.05 * depth_m) / (depth_m * depth_m)
    red, green, blue = own
    if material == _STRIPES:
        white = _wave(along + 0.6 * up, 0.5, 0.5, pixels_per_m)
        return (red + (240.0 - red) * white, green + (240.0 - green) * white, blue + (236.0 - blue) * white), 0.0
    if material == _RIBS:
        dark = 1.0 - 0.28 * _wave(along, 0.45, 0.4, pixels_per_m)
        return (red * dark, green * dark, blue * dark), 0.0
    window = _wave(up - 1.0, _FLOOR_M, 0.5, pixels_per_m)
    if window > 0.0:
        window *= _wave(along - 1.0, _BAY_M, 0.45, pixels_per_m)
    if window == 0.0:
        return own, 0.0
    lit = 0.0
    if night > 0.0:
        floor, bay = np.floor((up - 1.0) / _FLOOR_M), np.floor((along - 1.0) / _BAY_M)
        word = (seed * 7919 + int(floor) * 104729 + int(bay) * 1299709) & 0x7FFFFFFF
        lit = night if ((word ^ (word >> 7)) * 40503 >> 4) % 100 < 35 else 0.0
    red += (52.0 + 198.0 * lit - red) * window
    green += (66.0 + 139.0 * lit - green) * window
    blue += (84.0 + 36.0 * lit - blue) * window
    return (red, green, blue), 0.75 * lit * window


@njit(cache=True, error_model="numpy")
def _wave(place_m: float, period_m: float, share: float, pixels_per_m: float) -> float:
    """1 on the first `share` of every period, else 0, with edges as wide as a pixel."""
    steep = period_m * pixels_per_m
    if steep < 2.0:
        return share
    phase = place_m * (1.0 / period_m)
    phase -= np.floor(phase)
    rise = min(max(phase * steep + 0.5, 0.0), 1.0) + min(max((phase - 1.0) * steep + 0.5, 0.0), 1.0)
    fall = min(max((phase - share) * steep + 0.5, 0.0), 1.0)
    wave: float = min(max(rise - fall, 0.0), 1.0)
    return wave


@njit(cache=True, error_model="numpy")
def draw_shadows(image: NDArray[np.uint8], actors: Floats, view: View, factor: float) -> None:
    """Darkens the ground below `actors` (k, 10): their outline, a little grown. Call it before `draw_boxes`."""
    corners, clipped = np.empty((8, 3)), np.empty((8, 3))
    height, width = image.shape[0], image.shape[1]
    for k in range(len(actors)):
        if actors[k, _KIND] == _BUILDING:
            continue
        c, s = math.cos(actors[k, _YAW]), math.sin(actors[k, _YAW])
        ahead = 0.5 * actors[k, _LENGTH] + _SHADOW_MARGIN_M
        aside = 0.5 * actors[k, _WIDTH] + _SHADOW_MARGIN_M
        for corner in range(4):
            forward = ahead if corner < 2 else -ahead
            right = aside if corner == 1 or corner == 2 else -aside
            corners[corner, 0], corners[corner, 1], corners[corner, 2] = _to_camera(
                actors[k, _X] + c * forward - s * right, actors[k, _Y] + s * forward + c * right, 0.0, view
            )
        count = _clip_and_project(corners, _BOTTOM, clipped, view, width, height)
        if count < 3:
            continue
        low_v, high_v = _bounds(clipped, count, 1)
        for row in range(int(max(math.ceil(low_v - 0.5), 0.0)), int(min(math.floor(high_v - 0.5), height - 1.0)) + 1):
            low, high = _span(clipped, count, row + 0.5)
            for column in range(int(max(math.ceil(low - 0.5), 0.0)), int(min(math.floor(high - 0.5), width - 1.0)) + 1):
                for channel in range(3):
                    image[row, column, channel] = np.uint8(image[row, column, channel] * factor)
