"""Contact sheets of routes: one picture from above for each, side by side."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import cv2
import numpy as np

from pytest_drive_robust.arithmetic import scalars
from pytest_drive_robust.domain.observation import CameraSpec
from pytest_drive_robust.domain.truth import ActorKind, WorldState
from pytest_drive_robust.simulators.embedded.bev import draw_bev
from pytest_drive_robust.simulators.embedded.camera import CameraRig
from pytest_drive_robust.simulators.embedded.drawing.paint import Region
from pytest_drive_robust.simulators.embedded.geometry import place
from pytest_drive_robust.simulators.embedded.route_scene import RouteScene
from pytest_drive_robust.simulators.embedded.weathers import weather_name

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Pixels = NDArray[np.uint8]
    Colour = tuple[int, int, int]

__all__ = ["TILES_PER_SHEET", "draw_tile", "lay_sheets"]

TILES_PER_SHEET = 48
_CAPTION_PX = 46
_GAP_PX = 6
_FINER = 2
_LEAST_M, _MOST_M = 70.0, 120.0
_BEHIND_M, _AHEAD_M, _MARGIN_M = 10.0, 50.0, 11.0
_BEFORE_EGO_M = 30.0
_JUNCTION_M = 28.0
_RING_M = 1.3
_ARROW_S = 1.5
_SUBPIXEL_BITS = 4
_TRIGGER: Colour = (255, 60, 220)
_START: Colour = (40, 230, 240)
_FINISH: Colour = (255, 255, 255)
_ARROW: Colour = (255, 240, 60)
_WALK: Colour = (255, 140, 0)
_PAPER: Colour = (246, 246, 244)
_INK: Colour = (24, 24, 26)
_FAINT: Colour = (104, 104, 110)


def draw_tile(scene: RouteScene, *, size_px: int = 320, camera: CameraSpec | None = None) -> Pixels:
    """Return one captioned picture of a scene, (height, width, 3) uint8 RGB; with `camera`, what it sees on the right.

    The route is blue, from a cyan to a white ring; the magenta bar is the trigger point. Yellow arrows show where
    vehicles are in 1.5 s, orange ones the ways of those who walk, orange rings where they are now. The caption says id
    and type, town, length and weather.
    """
    picture = _from_above(scene, size_px)
    if camera is not None:
        camera = replace(camera, width_px=round(size_px * 16 / 9), height_px=size_px)
        rows = scene.world.dense.rows
        rig = CameraRig(scene.world.lane_map, scene.route.weather, (camera,), around=rows)
        picture = np.hstack((picture, rig.render(scene.frame)[camera.name]))
    caption = np.full((_CAPTION_PX, picture.shape[1], 3), _PAPER, np.uint8)
    length = scene.world.dense.length_m
    _write(caption, scene.route.label, 18, 0.46, _INK)
    _write(caption, f"{scene.route.town}, {length:.0f} m, {weather_name(scene.route.weather)}", 37, 0.4, _FAINT)
    return np.vstack((caption, picture))


def lay_sheets(tiles: Sequence[Pixels], *, columns: int = 8) -> Iterator[Pixels]:
    """Return tiles of one size in rows of `columns`, `TILES_PER_SHEET` on a sheet, on as many sheets as that takes."""
    for first in range(0, len(tiles), TILES_PER_SHEET):
        yield _sheet(tiles[first : first + TILES_PER_SHEET], min(columns, len(tiles)))


def _sheet(tiles: Sequence[Pixels], columns: int) -> Pixels:
    height, width = tiles[0].shape[0] + _GAP_PX, tiles[0].shape[1] + _GAP_PX
    rows = math.ceil(len(tiles) / columns)
    sheet = np.full((rows * height + _GAP_PX, columns * width + _GAP_PX, 3), _PAPER, np.uint8)
    for number, tile in enumerate(tiles):
        top, left = _GAP_PX + number // columns * height, _GAP_PX + number % columns * width
        sheet[top : top + tile.shape[0], left : left + tile.shape[1]] = tile
    return sheet


def _from_above(scene: RouteScene, size_px: int) -> Pixels:
    """Draw a scene from above, finer and reduced, so that paint and outlines stay smooth."""
    dense, fine = scene.world.dense, size_px * _FINER
    centre, metres = _frame_of_interest(scene)
    picture = draw_bev(dense.lane_map, scene.frame, dense.rows, size_px=fine, metres=metres, centre=centre, line_px=3)
    region = Region(centre[0] - metres / 2.0, centre[1] - metres / 2.0, fine, fine, metres / fine)
    for start, end in scene.walks:
        _arrow(picture, region, start, end, _WALK)
    for actor in scene.frame.actors:
        if actor[WorldState.KIND] in (ActorKind.PEDESTRIAN, ActorKind.BICYCLE):
            _ring(picture, region, actor[[WorldState.X, WorldState.Y]], _RING_M / region.texel_m, _WALK, 2)
        if actor[WorldState.SPEED] > 0.5 and actor[WorldState.KIND] != ActorKind.PEDESTRIAN:
            reach = (
                actor[WorldState.SPEED]
                * _ARROW_S
                * np.array((scalars.cos(actor[WorldState.YAW]), scalars.sin(actor[WorldState.YAW])))
            )
            _arrow(
                picture,
                region,
                actor[[WorldState.X, WorldState.Y]],
                actor[[WorldState.X, WorldState.Y]] + reach,
                _ARROW,
            )
    for row, colour in ((0, _START), (-1, _FINISH)):
        _ring(picture, region, dense.rows[row, :2], 6.0, colour, 3)
    left, right = (np.array(place(dense.rows[:, :3], dense.trigger_m, side)[:2]) for side in (-3.0, 3.0))
    _line(picture, region, left, right, _TRIGGER, 4)
    return np.asarray(cv2.resize(picture, (size_px, size_px), interpolation=cv2.INTER_AREA), np.uint8)


def _frame_of_interest(scene: RouteScene) -> tuple[tuple[float, float], float]:
    """Return centre and side of a square [m]: the route from its trigger to beyond the ego, and its first junction."""
    dense = scene.world.dense
    end_m = max(dense.trigger_m + _AHEAD_M, scene.ridden_m + _BEFORE_EGO_M)
    crossed_m = dense.s[[dense.lane_map.lanes[lane].junction for lane in dense.lanes]]
    if len(crossed_m) and crossed_m[0] < end_m + _AHEAD_M:
        end_m = max(end_m, crossed_m[0] + _JUNCTION_M)
    start_m = max(dense.trigger_m - _BEHIND_M, end_m - _MOST_M)
    points = dense.rows[(dense.s >= start_m) & (dense.s <= end_m), :2]
    low, high = points.min(axis=0) - _MARGIN_M, points.max(axis=0) + _MARGIN_M
    middle = (low + high) / 2.0
    return (float(middle[0]), float(middle[1])), float(np.clip((high - low).max(), _LEAST_M, _MOST_M))


def _arrow(picture: Pixels, region: Region, start: Floats, end: Floats, colour: Colour) -> None:
    _line(picture, region, start, end, colour, 2)
    away = end - start
    length = scalars.hypot(*away)
    if length < 1.0:
        return
    along, across = away / length * 1.4, np.array((-away[1], away[0])) / length * 0.9
    head = region.pixels(np.stack((end, end - along + across, end - along - across)))
    cv2.fillConvexPoly(picture, head, colour, cv2.LINE_AA, _SUBPIXEL_BITS)


def _ring(picture: Pixels, region: Region, middle: Floats, radius_px: float, colour: Colour, thick_px: int) -> None:
    radius = round(radius_px * (1 << _SUBPIXEL_BITS))
    cv2.circle(picture, _point(region.pixels(middle[None])[0]), radius, colour, thick_px, cv2.LINE_AA, _SUBPIXEL_BITS)


def _line(picture: Pixels, region: Region, start: Floats, end: Floats, colour: Colour, thick_px: int) -> None:
    first, last = region.pixels(np.stack((start, end)))
    cv2.line(picture, _point(first), _point(last), colour, thick_px, cv2.LINE_AA, _SUBPIXEL_BITS)


def _point(pixel: Iterable[np.int32]) -> tuple[int, int]:
    x, y = pixel
    return int(x), int(y)


def _write(picture: Pixels, text: str, baseline_px: int, scale: float, colour: Colour) -> None:
    """Write a line of text, smaller where it would be cut off."""
    font, room = cv2.FONT_HERSHEY_SIMPLEX, picture.shape[1] - 8
    width = cv2.getTextSize(text, font, scale, 1)[0][0]
    fitting = scale * min(1.0, room / max(width, 1))
    cv2.putText(picture, text, (4, baseline_px), font, fitting, colour, 1, cv2.LINE_AA)
