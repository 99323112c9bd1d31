"""Draw the ground of a map from above: the material and the paint of each place."""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from pytest_drive_robust.arithmetic import scalars
from pytest_drive_robust.arithmetic.arrays import cos, hypot, sin
from pytest_drive_robust.arithmetic.signals import interpolate
from pytest_drive_robust.domain.truth import Lane, LaneKind, LaneMap
from pytest_drive_robust.jit.arrays import Floats

Bytes = NDArray[np.uint8]

GRASS, SIDEWALK, KERB, PARKING, ASPHALT, BIKING = range(6)
"""The materials of `GroundSheet.material`."""

_LINE_WIDTH_M = 0.16
_DASH_M = 3.0
_GAP_M = 4.5
_STOP_LINE_DEPTH_M = 0.45
_ZEBRA_M = 0.5
_KERB_M = 0.18
_BEND_RAD = 0.03
_SUBPIXEL_BITS = 4


@dataclass(frozen=True, slots=True)
class Region:
    """A rectangle of the world (`x_m`, `y_m` is its corner of lowest x and y) cut in square texels of `texel_m`."""

    x_m: float
    y_m: float
    columns: int
    rows: int
    texel_m: float

    @classmethod
    def around(cls, points: Floats, margin_m: float, *, texel_m: float) -> Region:
        """Return the smallest region of whole texels that keeps `margin_m` around every one of `points` (n, 2)."""
        low = np.floor((points[:, :2].min(axis=0) - margin_m) / texel_m)
        high = np.ceil((points[:, :2].max(axis=0) + margin_m) / texel_m)
        # even, so that a coarser level halves without remainder
        columns, rows = (int(extent) + int(extent) % 2 for extent in high - low)
        return cls(float(low[0] * texel_m), float(low[1] * texel_m), columns, rows, texel_m)

    def pixels(self, points: Floats) -> NDArray[np.int32]:
        """Return points (n, 2) in metres as OpenCV's fixed-point pixel coordinates."""
        scaled = (points - (self.x_m, self.y_m)) / self.texel_m - 0.5
        rounded: NDArray[np.int32] = np.round(scaled * (1 << _SUBPIXEL_BITS)).astype(np.int32)
        return rounded

    def touches(self, points: Floats, margin_m: float) -> bool:
        """Return whether the bounding box of `points` (n, 2), grown by `margin_m`, overlaps the region."""
        low, high = points.min(axis=0) - margin_m, points.max(axis=0) + margin_m
        corner = (self.x_m + self.columns * self.texel_m, self.y_m + self.rows * self.texel_m)
        return bool(low[0] < corner[0] and low[1] < corner[1] and high[0] > self.x_m and high[1] > self.y_m)


@dataclass(frozen=True, slots=True)
class GroundSheet:
    """A region seen from above, three (rows, columns) uint8 pictures.

    `material` holds `GRASS`, `SIDEWALK`, ...; `white` and `yellow` are the coverage with paint, 0..255.
    """

    region: Region
    material: Bytes
    white: Bytes
    yellow: Bytes


def paint_ground(lane_map: LaneMap, region: Region) -> GroundSheet:
    """Paint the lanes, lane lines, stop lines and crosswalks of `lane_map` in `region`."""
    shape = (region.rows, region.columns)
    sheet = GroundSheet(region, np.full(shape, GRASS, np.uint8), np.zeros(shape, np.uint8), np.zeros(shape, np.uint8))
    lanes = [lane for lane in lane_map.lanes if region.touches(lane.centre[:, :2], lane.width_m)]
    bends = {lane.index: _bends(lane.centre) for lane in lanes}
    for kind, material, grow_m in (
        (LaneKind.SIDEWALK, KERB, _KERB_M),
        (LaneKind.SIDEWALK, SIDEWALK, 0.0),
        (LaneKind.PARKING, PARKING, 0.0),
        (LaneKind.BIKING, BIKING, 0.0),
        (LaneKind.DRIVING, ASPHALT, 0.0),
    ):
        for lane in lanes:
            if lane.kind == kind:
                half_m = lane.width_m / 2.0 + grow_m
                _strip(sheet.material, region, bends[lane.index], (-half_m, half_m), material)
    for lane in lanes:
        _lane_lines(sheet, lane_map.lanes, lane)
    for line in lane_map.stop_lines:
        _quad(sheet.white, region, rectangle(line.x_m, line.y_m, line.heading_rad, _STOP_LINE_DEPTH_M, line.width_m))
    for corners in lane_map.crosswalks:
        _zebra(sheet, corners)
    return sheet


def _bends(centre: Floats) -> Floats:
    """Keep the rows of `centre` that matter: both ends, and wherever the heading has turned since the last kept row."""
    keep = [0]
    for row in range(1, len(centre) - 1):
        if abs(math.remainder(centre[row + 1, 2] - centre[keep[-1], 2], math.tau)) > _BEND_RAD:
            keep.append(row)
    kept: Floats = centre[[*keep, len(centre) - 1]]
    return kept


def _beside(centre: Floats, offset_m: float) -> Floats:
    """Return the polyline `offset_m` to the right of `centre` (n, 3), as (n, 2)."""
    normal = np.column_stack((-sin(centre[:, 2]), cos(centre[:, 2])))
    moved: Floats = centre[:, :2] + offset_m * normal
    return moved


def _strip(target: Bytes, region: Region, centre: Floats, offsets_m: tuple[float, float], value: int) -> None:
    # Quad by quad: cv2.fillPoly fills even-odd, so a strip that overlaps itself would cancel.
    left, right = (region.pixels(_beside(centre, offset_m)) for offset_m in offsets_m)
    for row in range(len(centre) - 1):
        corners = np.stack((left[row], left[row + 1], right[row + 1], right[row]))
        cv2.fillConvexPoly(target, corners, value, cv2.LINE_8, _SUBPIXEL_BITS)


def _quad(target: Bytes, region: Region, corners: Floats) -> None:
    cv2.fillConvexPoly(target, region.pixels(corners), 255, cv2.LINE_AA, _SUBPIXEL_BITS)


def rectangle(x_m: float, y_m: float, yaw_rad: float, length_m: float, width_m: float) -> Floats:
    """Return the corners (4, 2) of a rectangle in metres: front right, front left, rear left, rear right."""
    c, s = scalars.cos(yaw_rad), scalars.sin(yaw_rad)
    along, across = np.array((c, s)) * length_m / 2.0, np.array((-s, c)) * width_m / 2.0
    return np.array((x_m, y_m)) + np.stack((along + across, along - across, -along - across, -along + across))


def _lane_lines(sheet: GroundSheet, lanes: tuple[Lane, ...], lane: Lane) -> None:
    for side, line, neighbour, same_way in (
        (-1.0, lane.left_line, lane.left, lane.left_same_way),
        (1.0, lane.right_line, lane.right, lane.right_same_way),
    ):
        if line == "none" or not _draws(lanes, lane, line, neighbour):
            continue
        opposite = neighbour >= 0 and not same_way and lanes[neighbour].kind == LaneKind.DRIVING == lane.kind
        edge = _beside(lane.centre, side * lane.width_m / 2.0)
        _line(sheet.yellow if opposite else sheet.white, sheet.region, edge, striped=line == "striped")


def _draws(lanes: tuple[Lane, ...], lane: Lane, line: str, neighbour: int) -> bool:
    """Return whether `lane`, not its neighbour, draws their shared line: two sets of dashes would fill the gaps."""
    if neighbour < 0:
        return True
    other = lanes[neighbour]
    theirs = other.left_line if other.left == lane.index else other.right_line if other.right == lane.index else "none"
    if theirs == line:
        return lane.index < other.index
    return theirs == "none" or line == "solid"


def _line(target: Bytes, region: Region, points: Floats, *, striped: bool) -> None:
    """Paint a line along `points` (n, 2); dashes start with the polyline."""
    steps = np.diff(points, axis=0)
    along = np.concatenate(([0.0], np.cumsum(hypot(steps[:, 0], steps[:, 1]))))
    total = float(along[-1])
    period, dash = (_DASH_M + _GAP_M, _DASH_M) if striped else (total + 1.0, total)
    for start in np.arange(0.0, total, period):
        stations = _stations(float(start), min(float(start) + dash, total))
        x, y = interpolate(stations, along, points[:, 0]), interpolate(stations, along, points[:, 1])
        for row in range(len(stations) - 1):
            length = scalars.hypot(x[row + 1] - x[row], y[row + 1] - y[row])
            yaw = scalars.atan2(y[row + 1] - y[row], x[row + 1] - x[row])
            middle = ((x[row] + x[row + 1]) / 2.0, (y[row] + y[row + 1]) / 2.0)
            _quad(target, region, rectangle(*middle, yaw, length + 0.02, _LINE_WIDTH_M))


def _stations(start_m: float, end_m: float) -> Floats:
    """Return stations from `start_m` to `end_m`, at most about 2 m apart."""
    stations: Floats = np.linspace(start_m, end_m, max(2, math.ceil((end_m - start_m) / 2.0) + 1))
    return stations


def _zebra(sheet: GroundSheet, corners: Floats) -> None:
    """Paint white bars across a crosswalk (4, 2), side by side along its longer side, where people walk."""
    first, second = corners[1] - corners[0], corners[3] - corners[0]
    if hypot(*first) < hypot(*second):
        first, second = second, first
    length = float(hypot(*first))
    bars = max(1, int(length / (2.0 * _ZEBRA_M)))
    for bar in range(bars):
        start, end = (bar + 0.25) / bars, (bar + 0.75) / bars
        _quad(
            sheet.white,
            sheet.region,
            corners[0] + np.stack((first * start, first * end, first * end + second, first * start + second)),
        )
