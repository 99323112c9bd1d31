"""Street lamps: places, boxes, and the light on the road."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from pytest_drive_robust.arithmetic import compiled, scalars
from pytest_drive_robust.arithmetic.arrays import hypot
from pytest_drive_robust.domain.truth import Lane, LaneKind, LaneMap
from pytest_drive_robust.jit.arrays import Floats
from pytest_drive_robust.jit.kernels import inner
from pytest_drive_robust.simulators.embedded.drawing.boxes import Box
from pytest_drive_robust.simulators.embedded.drawing.canvas import CameraView, Canvas
from pytest_drive_robust.simulators.embedded.drawing.packed import pack
from pytest_drive_robust.simulators.embedded.drawing.shadows import row_of

_EVERY_M = 30.0
_FIRST_M = 12.0
_BESIDE_M = 0.7
_CLEAR_M = 0.3
_POLE_M, _ARM_M = 6.2, 1.6
_STEEL = (96.0, 99.0, 104.0)
_DARK_HEAD = (176.0, 178.0, 180.0)
_WARM = (255.0, 224.0, 168.0)
_REACH_M = 140.0
_POOL_M = 9.5
_BRIGHTER = 3.4
_BRIGHTEST = 150.0
_FARTHEST_M = 70.0
_FLATTEST = -0.01
"""Slope of a row of pixels above which the row shows no ground."""
_0, _1 = np.float32(0.0), np.float32(1.0)
_FADE, _DARKER = np.float32(1.0 / (_POOL_M * _POOL_M)), np.float32(1.0 / (3.0 * _BRIGHTEST))
_GREEN, _BLUE = np.float32(0.92), np.float32(0.7)
"""The light is warm: green and blue gain less than red."""


def lamp_places(lane_map: LaneMap) -> Floats:
    """Return the feet of the lamps, (n, 3): x, y in metres and the direction to the road in radians.

    A lamp stands every 30 m along the right edge of each road, beyond parking and biking lanes, unless on another lane.
    """
    roads = [lane for lane in lane_map.lanes if lane.kind != LaneKind.SIDEWALK]
    points = np.concatenate([lane.centre[:, :2] for lane in roads]) if roads else np.zeros((0, 2))
    halves = (
        np.concatenate([np.full(len(lane.centre), lane.width_m / 2.0) for lane in roads]) if roads else points[:, 0]
    )
    places = []
    for lane in roads:
        beside = lane_map.lanes[lane.right].kind if lane.right >= 0 and lane.right_same_way else None
        if lane.kind is not LaneKind.DRIVING or lane.junction or beside is LaneKind.DRIVING:
            continue
        aside = lane.width_m / 2.0 + _width_beyond(lane_map, lane) + _BESIDE_M
        along = np.cumsum(hypot(*np.diff(lane.centre[:, :2], axis=0).T))
        at = np.searchsorted(along, np.arange(_FIRST_M, float(along[-1]) - 4.0, _EVERY_M))
        for x, y, heading in lane.centre[at]:
            foot = np.array((x - aside * scalars.sin(heading), y + aside * scalars.cos(heading)))
            if (hypot(*(points - foot).T) > halves + _CLEAR_M).all():
                places.append((foot[0], foot[1], heading - math.pi / 2.0))
    return np.array(places, np.float64).reshape(-1, 3)


def _width_beyond(lane_map: LaneMap, lane: Lane) -> float:
    """Return the width of the parking and biking lanes to the right of a driving lane."""
    width, index = 0.0, lane.right
    while index >= 0 and lane_map.lanes[index].kind in (LaneKind.PARKING, LaneKind.BIKING):
        width += lane_map.lanes[index].width_m
        index = lane_map.lanes[index].right
    return width


def lamp_boxes(places: Floats, *, night: float) -> list[Box]:
    """Return pole, arm and head of each lamp; the head glows by `night` 0..1."""
    boxes = []
    red, green, blue = (a + (b - a) * night for a, b in zip(_DARK_HEAD, _WARM, strict=True))
    for x, y, towards in places:
        reach_x, reach_y = scalars.cos(towards), scalars.sin(towards)
        middle_x, middle_y = x + 0.5 * _ARM_M * reach_x, y + 0.5 * _ARM_M * reach_y
        head_x, head_y = x + _ARM_M * reach_x, y + _ARM_M * reach_y
        head = (head_x, head_y, _POLE_M - 0.16, towards, 0.7, 0.28, 0.14)
        boxes += [
            Box(x, y, 0.0, towards, 0.14, 0.14, _POLE_M, _STEEL, reach_m=_REACH_M),
            Box(middle_x, middle_y, _POLE_M - 0.1, towards, _ARM_M, 0.09, 0.09, _STEEL, reach_m=60.0),
            Box(*head, (red, green, blue), glow=night, reach_m=_REACH_M),
        ]
    return boxes


@inner
def draw_pools(canvas: Canvas, places: Floats, view: CameraView, haze_per_m: float, strength: float) -> None:
    """Brighten the ground below the lamps at `places` by `strength` 0..1; bright pixels gain less."""
    colours, faces = canvas.colours, canvas.faces
    height, width = colours.shape
    nearest_m = _nearest_ground_m(view, height)
    for lamp in range(len(places)):
        towards = places[lamp, 2]
        dx = places[lamp, 0] + _ARM_M * compiled.cos(towards) - view.x_m
        dy = places[lamp, 1] + _ARM_M * compiled.sin(towards) - view.y_m
        ahead, aside = dx * view.cos_yaw + dy * view.sin_yaw, dy * view.cos_yaw - dx * view.sin_yaw
        if ahead < nearest_m - _POOL_M or ahead > _FARTHEST_M:
            continue
        deepest = (ahead + _POOL_M) * view.cos_pitch - view.z_m * view.sin_pitch
        if abs(aside) - _POOL_M > deepest * 0.5 * width / view.focal_px:
            continue
        gain = (
            strength * _BRIGHTER * compiled.exp(-haze_per_m * max(ahead, 0.0)) * (1.0 - max(ahead, 0.0) / _FARTHEST_M)
        )
        for row in range(row_of(ahead + _POOL_M, view, height), row_of(ahead - _POOL_M, view, height) + 1):
            up = (0.5 * height - row - 0.5) / view.focal_px
            rise = view.sin_pitch + up * view.cos_pitch
            if rise > _FLATTEST:
                continue
            depth = -view.z_m / rise
            forward = depth * (view.cos_pitch - up * view.sin_pitch) - ahead
            if abs(forward) < _POOL_M:
                _pool_row(colours[row], faces[row], forward, aside, depth / view.focal_px, gain)


@inner
def _nearest_ground_m(view: CameraView, height: int) -> float:
    """Return how far ahead the ground in the bottom row is: below 0 for a camera that looks down; 0 without ground."""
    up = (0.5 - 0.5 * height) / view.focal_px
    rise = view.sin_pitch + up * view.cos_pitch
    if rise > _FLATTEST:
        return 0.0
    return -view.z_m / rise * (view.cos_pitch - up * view.sin_pitch)


@inner
def _pool_row(
    colours: NDArray[np.uint32], faces: NDArray[np.int32], forward_m: float, aside_m: float, pixel_m: float, gain: float
) -> None:
    """Light one row of pixels through one pool, `forward_m` and `aside_m` from its middle."""
    width = len(colours)
    chord = math.sqrt(_POOL_M * _POOL_M - forward_m * forward_m)
    first = max(math.ceil(0.5 * width + (aside_m - chord) / pixel_m - 0.5), 0)
    last = min(math.floor(0.5 * width + (aside_m + chord) / pixel_m - 0.5), width - 1)
    if first > last:
        return
    nearest = _1 - np.float32(forward_m * forward_m) * _FADE
    start = np.float32((first + 0.5 - 0.5 * width) * pixel_m - aside_m)
    _lighten(colours[first : last + 1], faces[first : last + 1], nearest, start, np.float32(pixel_m), np.float32(gain))


@inner
def _lighten(
    colours: NDArray[np.uint32], faces: NDArray[np.int32], nearest: float, start: float, step: float, gain: float
) -> None:
    """Brighten the ground pixels of a row; in float32 without branches, so that the compiler emits vector code."""
    for u in range(len(colours)):
        colour = np.int32(colours[u])
        red, green, blue = (
            np.float32(np.int32(colour & 255)),
            np.float32(np.int32((colour >> 8) & 255)),
            np.float32(np.int32((colour >> 16) & 255)),
        )
        side = start + np.float32(np.int32(u)) * step
        near = nearest - side * side * _FADE
        dark = _1 - (red + green + blue) * _DARKER
        dark = dark if dark > _0 else _0
        more = gain * near * near * dark
        more = more if faces[u] == 0 else _0
        colours[u] = pack(red + red * more, green + green * more * _GREEN, blue + blue * more * _BLUE)
