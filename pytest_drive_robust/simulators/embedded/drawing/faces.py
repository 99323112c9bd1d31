"""Project the faces of boxes and fill them, exact in depth.

Faces are clipped at the near plane in camera coordinates (right, up, forward), projected, and filled row by row. The
inverse depth of a plane is linear in the picture, so the depth test is exact in every pixel.
"""

from __future__ import annotations

import numpy as np

from pytest_drive_robust.jit.arrays import Floats
from pytest_drive_robust.jit.kernels import inner
from pytest_drive_robust.simulators.embedded.drawing import canvas as face
from pytest_drive_robust.simulators.embedded.drawing.canvas import CameraView, Canvas

NEAR_M = 0.1
"""Distance of the near plane from the camera; nearer parts of boxes are cut away."""
_SMALLEST_AREA_PX2 = 1e-6
# Corners: front left, front right, rear right, rear left at the bottom, then at the top. The corners of a face are
# clockwise in the picture when the face is seen from outside.
_CORNERS = np.array(((0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7), (4, 5, 6, 7), (3, 2, 1, 0)), np.int64)


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


@inner
def bounds(cut: Floats, count: int, column: int) -> tuple[float, float]:
    """Return the lowest and highest value of a column of the first `count` rows."""
    low, high = cut[0, column], cut[0, column]
    for corner in range(1, count):
        value = cut[corner, column]
        low, high = value if value < low else low, value if value > high else high
    return low, high
