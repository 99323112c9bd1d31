"""Contact sheets of routes: one picture from above for each, side by side."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import cv2
import numpy as np

from pytest_drive_robust.arithmetic import scalars
from pytest_drive_robust.domain.observation import CameraSpec
from pytest_drive_robust.domain.truth import ActorKind, WorldState
from pytest_drive_robust.jit.arrays import Floats, Pixels
from pytest_drive_robust.simulators.embedded.bev import Sketch, draw_bev
from pytest_drive_robust.simulators.embedded.camera import CameraRig
from pytest_drive_robust.simulators.embedded.geometry import place
from pytest_drive_robust.simulators.embedded.route_scene import RouteScene
from pytest_drive_robust.simulators.embedded.weathers import weather_name

Colour = tuple[int, int, int]

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
_TRIGGER: Colour = (255, 60, 220)
_START: Colour = (40, 230, 240)
_FINISH: Colour = (255, 255, 255)
_ARROW: Colour = (255, 240, 60)
_WALK: Colour = (255, 140, 0)
_PAPER: Colour = (246, 246, 244)
_INK: Colour = (24, 24, 26)
_FAINT: Colour = (104, 104, 110)


def draw_tile(scene: RouteScene, *, size_px: int = 320, camera: CameraSpec | None = None) -> Pixels:
    """Return a captioned picture of a scene, (height, width, 3) uint8 RGB; on the right, the picture of `camera`.

    The route is blue, from a cyan to a white ring; the magenta bar is the trigger point. Yellow arrows show where
    vehicles will be in 1.5 s, orange arrows the ways of pedestrians, orange rings the pedestrians. The caption gives
    id and type, town, length and weather.
    """
    picture = _from_above(scene, size_px)
    if camera is not None:
        camera = replace(camera, width_px=round(size_px * 16 / 9), height_px=size_px)
        rows = scene.world.dense.rows
        rig = CameraRig(scene.world.lane_map, scene.route.weather, (camera,), around=rows)
        picture = np.hstack((picture, rig.render(scene.state)[camera.name]))
    caption = np.full((_CAPTION_PX, picture.shape[1], 3), _PAPER, np.uint8)
    length = scene.world.dense.length_m
    _write(caption, scene.route.label, 18, 0.46, _INK)
    _write(caption, f"{scene.route.town}, {length:.0f} m, {weather_name(scene.route.weather)}", 37, 0.4, _FAINT)
    return np.vstack((caption, picture))


def lay_sheets(tiles: Sequence[Pixels], *, columns: int = 8) -> Iterator[Pixels]:
    """Yield sheets of equally large tiles, in rows of `columns`, `TILES_PER_SHEET` per sheet."""
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
    sketch = draw_bev(dense.lane_map, scene.state, dense.rows, size_px=fine, metres=metres, centre=centre, line_px=3)
    for start, end in scene.walks:
        _arrow(sketch, start, end, _WALK)
    for actor in scene.state.actors:
        kind, speed, here = actor[WorldState.KIND], actor[WorldState.SPEED], actor[[WorldState.X, WorldState.Y]]
        if kind in (ActorKind.PEDESTRIAN, ActorKind.BICYCLE):
            sketch.disc(here, _RING_M * fine / metres, _WALK, 2)
        if speed > 0.5 and kind != ActorKind.PEDESTRIAN:
            reach = speed * _ARROW_S * np.array(scalars.cos_sin(actor[WorldState.YAW]))
            _arrow(sketch, here, here + reach, _ARROW)
    for row, colour in ((0, _START), (-1, _FINISH)):
        sketch.disc(dense.rows[row, :2], 6.0, colour, 3)
    sketch.line([place(dense.rows[:, :3], dense.trigger_m, side)[:2] for side in (-3.0, 3.0)], _TRIGGER, 4)
    return np.asarray(cv2.resize(sketch.pixels, (size_px, size_px), interpolation=cv2.INTER_AREA), np.uint8)


def _frame_of_interest(scene: RouteScene) -> tuple[tuple[float, float], float]:
    """Return centre and side [m] of a square around the route, from trigger to beyond the ego, and first junction."""
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


def _arrow(sketch: Sketch, start: Floats, end: Floats, colour: Colour) -> None:
    sketch.line((start, end), colour, 2)
    away = end - start
    length = scalars.hypot(*away)
    if length >= 1.0:
        along, across = away / length * 1.4, np.array((-away[1], away[0])) / length * 0.9
        sketch.fill((end, end - along + across, end - along - across), colour)


def _write(picture: Pixels, text: str, baseline_px: int, scale: float, colour: Colour) -> None:
    """Write a line of text, in a smaller font when the line would be cut off."""
    font, room = cv2.FONT_HERSHEY_SIMPLEX, picture.shape[1] - 8
    width = cv2.getTextSize(text, font, scale, 1)[0][0]
    fitting = scale * min(1.0, room / max(width, 1))
    cv2.putText(picture, text, (4, baseline_px), font, fitting, colour, 1, cv2.LINE_AA)
