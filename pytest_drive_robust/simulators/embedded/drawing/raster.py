"""Find which face of which box each pixel of one camera shows, exact in depth: geometry only, no colour.

Faces are clipped at the near plane in camera coordinates (right, up, forward), projected, and filled row by row. The
inverse depth of a plane is linear in the picture, so the depth test is exact in every pixel. `shade.py` computes the
colours afterwards, once per pixel.
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

_SMALLEST_PX = 0.75
_X, _Y, _LENGTH, _WIDTH, _HEIGHT = WorldState.X, WorldState.Y, WorldState.LENGTH, WorldState.WIDTH, WorldState.HEIGHT
_SIDES = 4
_SQUARE_ON = 0.4
NEAR_M = 0.1
"""Distance of the near plane from the camera; nearer parts of boxes are cut away."""
_SMALLEST_AREA_PX2 = 1e-6
# Corners: front left, front right, rear right, rear left at the bottom, then at the top. The corners of a face are
# clockwise in the picture when the face is seen from outside.
_CORNERS = np.array(((0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7), (4, 5, 6, 7), (3, 2, 1, 0)), np.int64)


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


@inner
def pick(seen: Floats, side: int, cut: Floats) -> int:
    """Copy a face's projected corners to `cut`; return 4, or 0 when the face looks away from the camera."""
    a, b, c, d = _CORNERS[side, 0], _CORNERS[side, 1], _CORNERS[side, 2], _CORNERS[side, 3]
    across_u, across_v = seen[c, 0] - seen[a, 0], seen[c, 1] - seen[a, 1]
    other_u, other_v = seen[d, 0] - seen[b, 0], seen[d, 1] - seen[b, 1]
    if across_u * other_v - across_v * other_u <= _SMALLEST_AREA_PX2:
        return 0
    for place in range(4):
        corner = _CORNERS[side, place]
        cut[place, 0], cut[place, 1], cut[place, 2] = seen[corner, 0], seen[corner, 1], seen[corner, 2]
    return 4


@inner
def clip(corners: Floats, side: int, cut: Floats, view: CameraView, width: int, height: int) -> int:
    """Clip a face at the near plane, project it to `cut`; return its number of corners, 0 if it is tiny or averted."""
    count = 0
    for place in range(4):
        here, there = _CORNERS[side, place], _CORNERS[side, (place + 1) % 4]
        z, next_z = corners[here, 2], corners[there, 2]
        if z >= NEAR_M:
            cut[count, 0], cut[count, 1], cut[count, 2] = corners[here, 0], corners[here, 1], z
            count += 1
        if (z >= NEAR_M) != (next_z >= NEAR_M):
            share = (NEAR_M - z) / (next_z - z)
            for axis in range(2):
                cut[count, axis] = corners[here, axis] + share * (corners[there, axis] - corners[here, axis])
            cut[count, 2] = NEAR_M
            count += 1
    area = 0.0
    for corner in range(count):
        inverse = 1.0 / cut[corner, 2]
        cut[corner, 0] = 0.5 * width + view.focal_px * cut[corner, 0] * inverse
        cut[corner, 1] = 0.5 * height - view.focal_px * cut[corner, 1] * inverse
        cut[corner, 2] = inverse
    for corner in range(1, count - 1):
        area += (cut[corner, 0] - cut[0, 0]) * (cut[corner + 1, 1] - cut[0, 1])
        area -= (cut[corner, 1] - cut[0, 1]) * (cut[corner + 1, 0] - cut[0, 0])
    return count if area > _SMALLEST_AREA_PX2 else 0


@inner
def bounds(cut: Floats, count: int, column: int) -> tuple[float, float]:
    """Return the lowest and highest value of a column of the first `count` rows."""
    low, high = cut[0, column], cut[0, column]
    for corner in range(1, count):
        value = cut[corner, column]
        low, high = value if value < low else low, value if value > high else high
    return low, high


@inner
def _plane(entry: Floats, cut: Floats, count: int) -> bool:
    """Compute a face's inverse depth over the picture from its projected corners; return False for one seen edge on."""
    # two diagonals span the plane, also where an edge has shrunk to nothing
    last = min(count - 1, 3)
    au, av, aw = cut[2, 0] - cut[0, 0], cut[2, 1] - cut[0, 1], cut[2, 2] - cut[0, 2]
    bu, bv, bw = cut[last, 0] - cut[1, 0], cut[last, 1] - cut[1, 1], cut[last, 2] - cut[1, 2]
    area = au * bv - av * bu
    if area <= 0.0:
        return False
    across, down = (aw * bv - av * bw) / area, (au * bw - aw * bu) / area
    entry[face.ACROSS], entry[face.DOWN] = across, down
    entry[face.OFFSET] = cut[0, 2] - across * cut[0, 0] - down * cut[0, 1]
    entry[face.FARTHEST], entry[face.NEAREST] = bounds(cut, count, 2)
    return True


@inner
def fill(canvas: Canvas, at: int, cut: Floats, count: int, keep: bool) -> bool:
    """Fill a projected face; return False when it meets no pixel. `keep` fills at least one pixel a row, for poles."""
    height, width = canvas.faces.shape
    low_u, high_u = bounds(cut, count, 0)
    low_v, high_v = bounds(cut, count, 1)
    first_row, last_row = _pixels(low_v, high_v, height, keep)
    first, last = _pixels(low_u, high_u, width, keep)
    if last_row < first_row or last < first or not _plane(canvas.table[at], cut, count):
        return False
    edges, touched, entry = canvas.edges, canvas.touched, canvas.table[at]
    if first_row == last_row:
        # a face lower than a row may cross no row's middle: start from its whole width
        edges[first_row, 0], edges[first_row, 1] = low_u, high_u
    _trace(edges, cut, count, first_row, last_row)
    across, down, offset = entry[face.ACROSS], entry[face.DOWN], entry[face.OFFSET]
    farthest, nearest = np.float32(entry[face.FARTHEST]), np.float32(entry[face.NEAREST])
    step, number = np.float32(across), np.int32(at)
    faces, nearness = canvas.faces, canvas.nearness
    for row in range(first_row, last_row + 1):
        first, last = _pixels(edges[row, 0], edges[row, 1], width, keep)
        if last < first:
            continue
        touched[row, 0], touched[row, 1] = min(touched[row, 0], first), max(touched[row, 1], last + 1)
        start = np.float32(across * (first + 0.5) + down * (row + 0.5) + offset)
        line = np.uintp(row)
        for step_px in range(last + 1 - first):
            column = np.uintp(first + step_px)
            near = start + np.float32(np.int32(step_px)) * step
            near = near if near > farthest else farthest
            near = near if near < nearest else nearest
            before = nearness[line, column]
            seen = near > before
            nearness[line, column] = near if seen else before
            faces[line, column] = number if seen else faces[line, column]
    return True


@inner
def _trace(edges: Floats, cut: Floats, count: int, first_row: int, last_row: int) -> None:
    """Find where a convex polygon, clockwise in the picture, crosses the middle of each row: left and right end."""
    for corner in range(count):
        after = corner + 1 if corner + 1 < count else 0
        u0, v0, u1, v1 = cut[corner, 0], cut[corner, 1], cut[after, 0], cut[after, 1]
        side = 1
        if v0 > v1:
            u0, v0, u1, v1 = u1, v1, u0, v0
            side = 0
        first = max(int(max(v0, 0.0) + 0.5), first_row)
        last = min(int(min(max(v1, 0.0), last_row + 1.0) + 0.5) - 1, last_row)
        if first > last:
            continue
        slope = (u1 - u0) / (v1 - v0)
        u = u0 + (first + 0.5 - v0) * slope
        for row in range(first, last + 1):
            edges[row, side] = u + (row - first) * slope


@inner
def _pixels(low: float, high: float, size: int, keep: bool) -> tuple[int, int]:
    """Return the first and last pixel whose centre lies in low..high; if none does, with `keep` the middle pixel."""
    first, last = int(max(low, 0.0) + 0.5), int(min(max(high, 0.0), float(size)) + 0.5) - 1
    if last < first and keep and high >= 0.0 and low < size:
        first = last = min(int(0.5 * (max(low, 0.0) + high)), size - 1)
    return first, last
