"""Find which face of which box each pixel of one camera shows, exact in depth: geometry only, no colour.

`faces.py` projects and fills the faces of a box; `shade.py` computes the colours afterwards, once per pixel.
"""

from __future__ import annotations

import math

import numpy as np

from pytest_drive_robust.domain.truth import WorldState
from pytest_drive_robust.jit.arrays import Floats
from pytest_drive_robust.jit.kernels import inner
from pytest_drive_robust.simulators.embedded.drawing import boxes as box
from pytest_drive_robust.simulators.embedded.drawing import canvas as face
from pytest_drive_robust.simulators.embedded.drawing.canvas import CameraView, Canvas, FrameScene, Triple
from pytest_drive_robust.simulators.embedded.drawing.faces import NEAR_M, bounds, clip, fill, pick

_SMALLEST_PX = 0.75
_X, _Y, _LENGTH, _WIDTH, _HEIGHT = WorldState.X, WorldState.Y, WorldState.LENGTH, WorldState.WIDTH, WorldState.HEIGHT
_SIDES = 4
_SQUARE_ON = 0.4


@inner
def draw_faces(canvas: Canvas, scene: FrameScene, view: CameraView) -> None:
    """Draw boxes into `canvas.faces` and `canvas.nearness`; write a row of `canvas.table` for each face.

    Near boxes are drawn first, so that most hidden faces are never filled. The parts of an actor keep their order; if
    two faces are equally near, the face drawn first is seen.
    """
    rows, still, ends = scene.rows, scene.still, scene.ends
    _wipe(canvas)
    corners, seen, cut = np.empty((8, 3)), np.empty((8, 3)), np.empty((8, 3))
    order, used = canvas.order, int(np.int64(1))  # a literal would be compiled for as a type of its own
    for place in range(_near_to_far(canvas, scene, view)):
        if order[place] < still:
            used = _draw_box(canvas, used, order[place], rows[order[place]], corners, seen, cut, view)
            continue
        k = order[place] - still
        for row in range(ends[k], ends[k + 1]):
            used = _draw_box(canvas, used, row, rows[row], corners, seen, cut, view)


@inner
def _near_to_far(canvas: Canvas, scene: FrameScene, view: CameraView) -> int:
    """Fill `canvas.order` with the things in sight, near to far: static boxes by row, actors by `still` + row."""
    rows, still, actors = scene.rows, scene.still, scene.actors
    order, keys = canvas.order, canvas.keys
    height, width = canvas.faces.shape
    count = 0
    for thing in range(still + len(actors)):
        if thing < still:
            b = rows[thing]
            middle = _to_camera(b[box.X], b[box.Y], b[box.Z] + 0.5 * b[box.HIGH], view)
            radius = _radius(b)
            if middle[2] > b[box.REACH]:
                continue
        else:
            a = actors[thing - still]
            middle = _to_camera(a[_X], a[_Y], 0.5 * a[_HEIGHT], view)
            # 0.75 of the diagonal instead of 0.5, because parts may stick out of the actor's box
            radius = 0.75 * math.sqrt(a[_LENGTH] * a[_LENGTH] + a[_WIDTH] * a[_WIDTH] + a[_HEIGHT] * a[_HEIGHT])
        if not _in_sight(middle, radius, view.focal_px, width, height):
            continue
        key, place = middle[2] - radius, count
        while place > 0 and keys[place - 1] > key:
            keys[place], order[place] = keys[place - 1], order[place - 1]
            place -= 1
        keys[place], order[place] = key, thing
        count += 1
    return count


@inner
def _radius(b: Floats) -> float:
    """Return the radius of the sphere around a box."""
    grow = max(-b[box.FRONT], 0.0) + max(-b[box.REAR], 0.0) + 2.0 * max(-b[box.SIDES], 0.0)
    along, wide, high = b[box.ALONG] + grow, b[box.WIDE] + grow, b[box.HIGH]
    return 0.5 * math.sqrt(along * along + wide * wide + high * high)


@inner
def _wipe(canvas: Canvas) -> None:
    faces, nearness, touched = canvas.faces, canvas.nearness, canvas.touched
    for row in range(faces.shape[0]):
        first, end = touched[row, 0], touched[row, 1]
        if first < end:
            faces[row, first:end] = 0
            nearness[row, first:end] = np.float32(0.0)
        touched[row, 0], touched[row, 1] = faces.shape[1], 0


@inner
def _to_camera(x: float, y: float, z: float, view: CameraView) -> Triple:
    dx, dy, dz = x - view.x_m, y - view.y_m, z - view.z_m
    ahead = dx * view.cos_yaw + dy * view.sin_yaw
    right = dy * view.cos_yaw - dx * view.sin_yaw
    return right, dz * view.cos_pitch - ahead * view.sin_pitch, ahead * view.cos_pitch + dz * view.sin_pitch


@inner
def _in_sight(middle: Triple, radius: float, focal_px: float, width: int, height: int) -> bool:
    """Return whether a sphere is in sight: not behind the camera and not beside the picture."""
    right, up, forward = middle
    if forward + radius < NEAR_M:
        return False
    half = 0.5 * width / focal_px
    if abs(right) - half * forward > radius * math.sqrt(1.0 + half * half):
        return False
    half = 0.5 * height / focal_px
    return abs(up) - half * forward <= radius * math.sqrt(1.0 + half * half)


@inner
def _draw_box(
    canvas: Canvas, used: int, row: int, b: Floats, corners: Floats, seen: Floats, cut: Floats, view: CameraView
) -> int:
    height, width = canvas.faces.shape
    middle = _to_camera(b[box.X], b[box.Y], b[box.Z] + 0.5 * b[box.HIGH], view)
    radius, forward = _radius(b), middle[2]
    if forward > b[box.REACH] or not _in_sight(middle, radius, view.focal_px, width, height):
        return used
    # a lamp is drawn however small it is
    if b[box.GLOW] == 0.0 and 2.0 * radius * view.focal_px < _SMALLEST_PX * forward:
        return used
    whole = _place_corners(corners, b, middle, view) >= NEAR_M
    if whole:
        for corner in range(8):
            inverse = 1.0 / corners[corner, 2]
            seen[corner, 0] = 0.5 * width + view.focal_px * corners[corner, 0] * inverse
            seen[corner, 1] = 0.5 * height - view.focal_px * corners[corner, 1] * inverse
            seen[corner, 2] = inverse
        if _hidden(canvas, seen):
            return used
    # the camera's place in the box's axes
    dx, dy = view.x_m - b[box.X], view.y_m - b[box.Y]
    ahead, right = dx * b[box.COS] + dy * b[box.SIN], dy * b[box.COS] - dx * b[box.SIN]
    away = _SQUARE_ON * math.sqrt(dx * dx + dy * dy + middle[1] * middle[1])
    for side in range(6):
        count = pick(seen, side, cut) if whole else clip(corners, side, cut, view, width, height)
        if count < 3:
            continue
        if side == 0 or side == 2:
            keep = (ahead if side == 0 else -ahead) - 0.5 * b[box.ALONG] > away
        else:
            keep = side < _SIDES and (right if side == 1 else -right) - 0.5 * b[box.WIDE] > away
        if fill(canvas, used, cut, count, keep):
            canvas.table[used, face.BOX], canvas.table[used, face.SIDE] = row, side
            canvas.table[used, face.PACKED] = face.UNLIT
            used += 1
    return used


@inner
def _hidden(canvas: Canvas, seen: Floats) -> bool:
    """Return whether each pixel around the projected corners already shows a face nearer than the nearest corner."""
    height, width = canvas.faces.shape
    low_u, high_u = bounds(seen, 8, 0)
    low_v, high_v = bounds(seen, 8, 1)
    nearest = np.float32(bounds(seen, 8, 2)[1])
    first, last = int(max(low_u - 0.5, 0.0)), int(min(high_u + 0.5, width - 1.0))
    for row in range(int(max(low_v - 0.5, 0.0)), int(min(high_v + 0.5, height - 1.0)) + 1):
        for column in range(first, last + 1):
            if canvas.nearness[row, column] < nearest:
                return False
    return True


@inner
def _place_corners(corners: Floats, b: Floats, middle: Triple, view: CameraView) -> float:
    """Fill in the camera coordinates of the eight corners; return the depth of the nearest."""
    # the box's own axes in camera axes
    ahead = b[box.COS] * view.cos_yaw + b[box.SIN] * view.sin_yaw
    aside = b[box.SIN] * view.cos_yaw - b[box.COS] * view.sin_yaw
    nearest = 1e30
    for top in range(2):
        share = float(top)
        lift = (share - 0.5) * b[box.HIGH]
        up, forward = middle[1] + lift * view.cos_pitch, middle[2] + lift * view.sin_pitch
        front = 0.5 * b[box.ALONG] - share * b[box.FRONT]
        rear = -0.5 * b[box.ALONG] + share * b[box.REAR]
        half = 0.5 * b[box.WIDE] - share * b[box.SIDES]
        for place in range(4):
            x = front if place < 2 else rear
            y = half if place == 1 or place == 2 else -half
            level = x * ahead - y * aside
            at = 4 * top + place
            corners[at, 0] = middle[0] + x * aside + y * ahead
            corners[at, 1] = up - level * view.sin_pitch
            corners[at, 2] = forward + level * view.cos_pitch
            nearest = min(nearest, corners[at, 2])
    return nearest
