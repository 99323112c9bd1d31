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
    Surface = tuple[float, float, float, float, float, float, float, float]

__all__ = ["CORNERS", "draw_boxes", "draw_shadows"]

_NEAR_M = 0.1
_STRIPES, _RIBS = int(box.Material.STRIPES), int(box.Material.RIBS)
_KIND, _X, _Y, _YAW, _LENGTH, _WIDTH = Frame.KIND, Frame.X, Frame.Y, Frame.YAW, Frame.LENGTH, Frame.WIDTH
_BUILDING = int(ActorKind.BUILDING)
_SHADOW_MARGIN_M = 0.12

CORNERS = np.array(
    ((0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7), (4, 5, 6, 7), (0, 1, 2, 3)), np.int64
)
"""The corners of the front, right, rear, left, top and bottom face of a box (see `_corners`)."""


@njit(cache=True)  # type: ignore[misc, unused-ignore]
def draw_boxes(
    image: NDArray[np.uint8],
    depth: NDArray[np.float32],
    rows: Floats,
    count: int,
    view: View,
    air: Air,
    lamps: Headlamps,
    clear: Floats,
) -> None:
    """Draws the first `count` of `rows` into `image` (height, width, 3).

    `depth` (height, width) is scratch: the inverse depth in 1/m of what is seen, 0 where no box is. `clear` is the
    share of a surface's colour that survives the air, by whole metres of depth.
    """
    depth[:] = 0.0
    corners, polygon, clipped = np.empty((8, 3)), np.empty((8, 3)), np.empty((8, 3))
    for at in range(count):
        b = rows[at]
        if not _may_be_seen(b, view, image.shape[1], image.shape[0]):
            continue
        _corners(corners, b, view)
        for face in range(6):
            _draw_face(image, depth, corners, polygon, clipped, face, b, view, air, lamps, clear)


@njit(cache=True)  # type: ignore[misc, unused-ignore]
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


@njit(cache=True)  # type: ignore[misc, unused-ignore]
def _to_camera(x: float, y: float, z: float, view: View) -> tuple[float, float, float]:
    dx, dy, dz = x - view.x_m, y - view.y_m, z - view.z_m
    cos_yaw, sin_yaw = math.cos(view.yaw_rad), math.sin(view.yaw_rad)
    cos_pitch, sin_pitch = math.cos(view.pitch_rad), math.sin(view.pitch_rad)
    ahead = dx * cos_yaw + dy * sin_yaw
    return dy * cos_yaw - dx * sin_yaw, dz * cos_pitch - ahead * sin_pitch, ahead * cos_pitch + dz * sin_pitch


@njit(cache=True)  # type: ignore[misc, unused-ignore]
def _corners(corners: Floats, b: Floats, view: View) -> None:
    """Camera coordinates of front left, front right, rear right, rear left at the bottom, then the same at the top."""
    c, s = math.cos(b[box.YAW]), math.sin(b[box.YAW])
    for corner in range(8):
        top = 1.0 if corner >= 4 else 0.0
        place = corner % 4
        forward = 0.5 * b[box.ALONG] - top * b[box.FRONT] if place < 2 else -0.5 * b[box.ALONG] + top * b[box.REAR]
        right = 0.5 * b[box.WIDE] - top * b[box.SIDES]
        if place == 0 or place == 3:
            right = -right
        x, y = b[box.X] + c * forward - s * right, b[box.Y] + s * forward + c * right
        corners[corner, 0], corners[corner, 1], corners[corner, 2] = _to_camera(
            x, y, b[box.Z] + top * b[box.HIGH], view
        )


@njit(cache=True)  # type: ignore[misc, unused-ignore]
def _draw_face(
    image: NDArray[np.uint8],
    depth: NDArray[np.float32],
    corners: Floats,
    polygon: Floats,
    clipped: Floats,
    face: int,
    b: Floats,
    view: View,
    air: Air,
    lamps: Headlamps,
    clear: Floats,
) -> None:
    p0, p1, p2, p3 = (
        corners[CORNERS[face, 0]],
        corners[CORNERS[face, 1]],
        corners[CORNERS[face, 2]],
        corners[CORNERS[face, 3]],
    )
    # the diagonals span the plane, also where an edge has shrunk to nothing
    nx, ny, nz = _cross(p2, p0, p3, p1)
    size = math.sqrt(nx * nx + ny * ny + nz * nz)
    if size < 1e-9:
        return
    nx, ny, nz = nx / size, ny / size, nz / size
    inner = 0.0
    for axis in range(3):
        middle = 0.0
        for corner in range(8):
            middle += corners[corner, axis]
        inner += (nx if axis == 0 else ny if axis == 1 else nz) * (p0[axis] - middle / 8.0)
    if inner < 0.0:
        nx, ny, nz = -nx, -ny, -nz
    distance = nx * p0[0] + ny * p0[1] + nz * p0[2]
    if distance > -1e-6:
        return
    for corner in range(4):
        polygon[corner] = corners[CORNERS[face, corner]]
    count = _clip_and_project(polygon, clipped, view, image.shape[1], image.shape[0])
    if count < 3:
        return
    shade, extra = _shade(nx, ny, nz, b, view, air, lamps)
    focal = view.focal_px
    plane = (nx / (focal * distance), -ny / (focal * distance), 0.0)
    offset = nz / distance - plane[0] * image.shape[1] / 2.0 - plane[1] * image.shape[0] / 2.0
    surface = _surface(p0, p1, distance, b, face, view, image.shape[1], image.shape[0])
    _fill(image, depth, clipped, count, (plane[0], plane[1], offset), b, shade, extra, surface, view, air, clear)


@njit(cache=True)  # type: ignore[misc, unused-ignore]
def _cross(a1: Floats, a0: Floats, b1: Floats, b0: Floats) -> tuple[float, float, float]:
    ax, ay, az = a1[0] - a0[0], a1[1] - a0[1], a1[2] - a0[2]
    bx, by, bz = b1[0] - b0[0], b1[1] - b0[1], b1[2] - b0[2]
    return ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx


@njit(cache=True)  # type: ignore[misc, unused-ignore]
def _shade(
    nx: float, ny: float, nz: float, b: Floats, view: View, air: Air, lamps: Headlamps
) -> tuple[float, float]:
    """Sun and sky on a face whose normal in camera coordinates is (nx, ny, nz), and the ego's headlamps on it."""
    cos_yaw, sin_yaw = math.cos(view.yaw_rad), math.sin(view.yaw_rad)
    cos_pitch, sin_pitch = math.cos(view.pitch_rad), math.sin(view.pitch_rad)
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


@njit(cache=True)  # type: ignore[misc, unused-ignore]
def _clip_and_project(polygon: Floats, clipped: Floats, view: View, width: int, height: int) -> int:
    """Cuts `polygon` (4 corners, camera coordinates) at the near plane; `clipped` gets u, v, 1/depth. Their number."""
    count = 0
    for corner in range(4):
        here, there = polygon[corner], polygon[(corner + 1) % 4]
        if here[2] >= _NEAR_M:
            clipped[count] = here
            count += 1
        if (here[2] >= _NEAR_M) != (there[2] >= _NEAR_M):
            share = (_NEAR_M - here[2]) / (there[2] - here[2])
            for axis in range(2):
                clipped[count, axis] = here[axis] + share * (there[axis] - here[axis])
            clipped[count, 2] = _NEAR_M
            count += 1
    for corner in range(count):
        inverse = 1.0 / clipped[corner, 2]
        clipped[corner, 0] = width / 2.0 + view.focal_px * clipped[corner, 0] * inverse
        clipped[corner, 1] = height / 2.0 - view.focal_px * clipped[corner, 1] * inverse
        clipped[corner, 2] = inverse
    return count


@njit(cache=True)  # type: ignore[misc, unused-ignore]
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


@njit(cache=True)  # type: ignore[misc, unused-ignore]
def _bounds(corners: Floats, count: int, column: int) -> tuple[float, float]:
    low, high = 1e30, -1e30
    for corner in range(count):
        low, high = min(low, corners[corner, column]), max(high, corners[corner, column])
    return low, high


@njit(cache=True)  # type: ignore[misc, unused-ignore]
def _pixels(low: float, high: float, size: int) -> tuple[int, int]:
    """First and last pixel whose centre lies in low..high; the one in the middle where that is none."""
    first, last = math.ceil(low - 0.5), math.floor(high - 0.5)
    if last < first:
        first = last = math.floor((low + high) / 2.0)
    return int(max(first, 0.0)), int(min(last, size - 1.0))


@njit(cache=True)  # type: ignore[misc, unused-ignore]
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
) -> None:
    """Fills a projected face; thin ones keep at least one pixel a row, so that poles do not break up far away."""
    height, width = image.shape[0], image.shape[1]
    v_low, v_high = _bounds(corners, count, 1)
    if v_high < 0.0 or v_low > height:
        return
    u_low, u_high = _bounds(corners, count, 0)
    nearest, farthest = _bounds(corners, count, 2)[1], _bounds(corners, count, 2)[0]
    glow, material = b[box.GLOW], int(b[box.MATERIAL])
    patterned = material != 0 and surface[7] > 0.0
    first_row, last_row = _pixels(v_low, v_high, height)
    for row in range(first_row, last_row + 1):
        v = row + 0.5
        low, high = _span(corners, count, v)
        if low > high:
            low, high = u_low, u_high
        if high < 0.0 or low > width:
            continue
        first, last = _pixels(low, high, width)
        for column in range(first, last + 1):
            u = column + 0.5
            inverse = min(max(plane[0] * u + plane[1] * v + plane[2], farthest), nearest)
            if inverse <= depth[row, column]:
                continue
            depth[row, column] = inverse
            red, green, blue, own = b[box.RED], b[box.GREEN], b[box.BLUE], glow
            if patterned:
                red, green, blue, own = _pattern(material, surface, u, v, inverse, b, view.focal_px, air.night)
            left = clear[min(int(1.0 / inverse), len(clear) - 1)]
            # a lamp is seen farther through haze than what it does not light
            left += (1.0 - left) * 0.35 * own
            lost = 1.0 - left
            plain = (1.0 - own) * left
            own *= left
            image[row, column, 0] = np.uint8(
                min(red * (own + plain * (shade * air.light[0] + extra)) + air.haze[0] * lost + 0.5, 255.0)
            )
            image[row, column, 1] = np.uint8(
                min(green * (own + plain * (shade * air.light[1] + extra)) + air.haze[1] * lost + 0.5, 255.0)
            )
            image[row, column, 2] = np.uint8(
                min(blue * (own + plain * (shade * air.light[2] + extra)) + air.haze[2] * lost + 0.5, 255.0)
            )


@njit(cache=True)  # type: ignore[misc, unused-ignore]
def _surface(
    p0: Floats, p1: Floats, distance: float, b: Floats, face: int, view: View, width: int, height: int
) -> Surface:
    """How a place in the picture maps to metres along the face (from its corner p0) and up from the box's bottom.

    along = (s0 * u + s1 * v + s2) / inverse depth - s3, up = (s4 * v + s5) / inverse depth + s6; s7 is the distance of
    the camera to the face's plane, 0 for faces without a pattern.
    """
    if b[box.MATERIAL] == 0.0 or face > 3:
        return (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    size = max(math.sqrt((p1[0] - p0[0]) ** 2 + (p1[1] - p0[1]) ** 2 + (p1[2] - p0[2]) ** 2), 1e-6)
    ax, ay, az = (p1[0] - p0[0]) / size, (p1[1] - p0[1]) / size, (p1[2] - p0[2]) / size
    focal = view.focal_px
    cos_pitch, sin_pitch = math.cos(view.pitch_rad), math.sin(view.pitch_rad)
    return (
        ax / focal,
        -ay / focal,
        az - ax * width / 2.0 / focal + ay * height / 2.0 / focal,
        p0[0] * ax + p0[1] * ay + p0[2] * az,
        -cos_pitch / focal,
        sin_pitch + cos_pitch * height / 2.0 / focal,
        view.z_m - b[box.Z],
        -distance,
    )


@njit(cache=True)  # type: ignore[misc, unused-ignore]
def _pattern(
    material: int, surface: Surface, u: float, v: float, inverse: float, b: Floats, focal: float, night: float
) -> tuple[float, float, float, float]:
    """Colour and glow of a place on a patterned face; a pattern that is too fine for the pixel fades to its mean."""
    along = (surface[0] * u + surface[1] * v + surface[2]) / inverse - surface[3]
    up = (surface[4] * v + surface[5]) / inverse + surface[6]
    footprint = 1.0 / (inverse * focal) / max(surface[7] * inverse, 0.05)
    red, green, blue = b[box.RED], b[box.GREEN], b[box.BLUE]
    if material == _STRIPES:
        white = _wave(along + 0.6 * up, 0.5, 0.5, footprint)
        return red + (240.0 - red) * white, green + (240.0 - green) * white, blue + (236.0 - blue) * white, 0.0
    if material == _RIBS:
        dark = 1.0 - 0.28 * _wave(along, 0.45, 0.4, footprint)
        return red * dark, green * dark, blue * dark, 0.0
    window = _wave(along - 1.0, 3.2, 0.45, footprint) * _wave(up - 1.0, 3.1, 0.5, footprint)
    floor, bay = math.floor((up - 1.0) / 3.1), math.floor((along - 1.0) / 3.2)
    word = (int(b[box.SEED]) * 7919 + int(floor) * 104729 + int(bay) * 1299709) & 0x7FFFFFFF
    lit = night if ((word ^ (word >> 7)) * 40503 >> 4) % 100 < 35 else 0.0
    red += (52.0 + 198.0 * lit - red) * window
    green += (66.0 + 139.0 * lit - green) * window
    blue += (84.0 + 36.0 * lit - blue) * window
    return red, green, blue, 0.75 * lit * window


@njit(cache=True)  # type: ignore[misc, unused-ignore]
def _wave(place: float, period: float, share: float, footprint: float) -> float:
    """1 on the first `share` of every period, else 0, with edges as wide as a pixel's footprint."""
    phase = place / period
    phase = (phase - math.floor(phase)) * period
    soft = max(footprint, 1e-3)
    if soft > 0.5 * period:
        return share
    rise = min(max(phase / soft + 0.5, 0.0), 1.0) + min(max((phase - period) / soft + 0.5, 0.0), 1.0)
    fall = min(max((phase - share * period) / soft + 0.5, 0.0), 1.0)
    return min(max(rise - fall, 0.0), 1.0)


@njit(cache=True)  # type: ignore[misc, unused-ignore]
def draw_shadows(image: NDArray[np.uint8], actors: Floats, view: View, factor: float) -> None:
    """Darkens the ground below `actors` (k, 10): their outline, a little grown. Call it before `draw_boxes`."""
    polygon, clipped = np.empty((8, 3)), np.empty((8, 3))
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
            polygon[corner, 0], polygon[corner, 1], polygon[corner, 2] = _to_camera(
                actors[k, _X] + c * forward - s * right, actors[k, _Y] + s * forward + c * right, 0.0, view
            )
        count = _clip_and_project(polygon, clipped, view, width, height)
        if count < 3:
            continue
        low_v, high_v = _bounds(clipped, count, 1)
        for row in range(int(max(math.ceil(low_v - 0.5), 0.0)), int(min(math.floor(high_v - 0.5), height - 1.0)) + 1):
            low, high = _span(clipped, count, row + 0.5)
            for column in range(int(max(math.ceil(low - 0.5), 0.0)), int(min(math.floor(high - 0.5), width - 1.0)) + 1):
                for channel in range(3):
                    image[row, column, channel] = np.uint8(image[row, column, channel] * factor)
