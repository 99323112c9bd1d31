"""The world from above, for people: what the cameras should show, without perspective."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np

from pytest_drive_robust.arithmetic import scalars
from pytest_drive_robust.domain.truth import ActorKind, ActorState
from pytest_drive_robust.simulators.embedded.drawing.furniture import LAMP_COLOURS
from pytest_drive_robust.simulators.embedded.drawing.looks import paint_of
from pytest_drive_robust.simulators.embedded.drawing.paint import Region, paint_ground
from pytest_drive_robust.simulators.embedded.drawing.texture import pack_sheet, unpack

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pytest_drive_robust.domain.truth import LaneMap, WorldState

    Floats = NDArray[np.float64]
    Pixels = NDArray[np.uint8]
    Colour = tuple[int, int, int]

__all__ = ["draw_bev"]

_EGO: Colour = (40, 230, 240)
_ROUTE: Colour = (60, 130, 255)
_TRAIL: Colour = (255, 80, 220)
_BUILDING: Colour = (120, 100, 90)
_OUTLINE: Colour = (20, 20, 20)
_SIREN: Colour = (40, 90, 255)
_STOP_SIGN: Colour = (190, 20, 28)
_FIXED_COLOURS: dict[ActorKind, Colour] = {
    ActorKind.EMERGENCY: (245, 245, 245),
    ActorKind.CONE: (255, 120, 20),
    ActorKind.BARRIER: (230, 50, 50),
    ActorKind.WARNING_SIGN: (230, 50, 50),
    ActorKind.DOOR: (255, 120, 20),
    ActorKind.DIRT: (126, 92, 58),
    ActorKind.BUILDING: _BUILDING,
}
_SUBPIXEL_BITS = 4


def draw_bev(
    lane_map: LaneMap,
    frame: WorldState,
    route: NDArray[np.float64],
    *,
    size_px: int = 512,
    metres: float = 80.0,
    centre: tuple[float, float] | None = None,
    trail: NDArray[np.float64] | None = None,
    line_px: int = 1,
) -> Pixels:
    """Draw a square of `metres` around `centre` (None: the ego) as (size_px, size_px, 3) uint8 RGB: x right, y down.

    `route` (n, 2 or more) and `trail` (m, 2 or more: where the ego has been) are points in metres; either may be empty;
    `line_px` is how thick they are drawn.
    """
    x, y = centre if centre is not None else (frame.ego.x_m, frame.ego.y_m)
    region = Region(x - metres / 2.0, y - metres / 2.0, size_px, size_px, metres / size_px)
    picture = np.ascontiguousarray(unpack(pack_sheet(paint_ground(lane_map, region))))
    _path(picture, region, route, _ROUTE, line_px)
    if trail is not None:
        _path(picture, region, trail, _TRAIL, line_px)
    for row in lane_map.buildings:
        _outline(picture, region, row[:5], _BUILDING)
    for index, line in enumerate(lane_map.stop_lines):
        colour = _STOP_SIGN
        if line.is_light:
            colour = next((_whole(c) for state, c in LAMP_COLOURS.items() if state == frame.lights[index]), _OUTLINE)
        _light(picture, region, (line.pole_x_m, line.pole_y_m), line.heading_rad, colour)
    for actor in frame.actors:
        _actor(picture, region, actor, frame)
    ego = frame.ego
    _vehicle(picture, region, np.array((ego.x_m, ego.y_m, ego.yaw_rad, ego.length_m, ego.width_m)), _EGO)
    return picture


def _whole(colour: tuple[float, float, float]) -> Colour:
    red, green, blue = (int(channel) for channel in colour)
    return red, green, blue


def _path(picture: Pixels, region: Region, points: Floats, colour: Colour, line_px: int) -> None:
    if len(points) >= 2:
        pixels = region.pixels(np.asarray(points, np.float64)[:, :2])
        cv2.polylines(picture, [pixels], False, colour, line_px, cv2.LINE_AA, _SUBPIXEL_BITS)


def _corners(place: Floats) -> Floats:
    """Return the corners (4, 2) of a rectangle x, y, yaw, length, width: front right and left, rear left and right."""
    x, y, yaw, length, width = (float(value) for value in place)
    c, s = scalars.cos_sin(yaw)
    along, across = np.array((c, s)) * length / 2.0, np.array((-s, c)) * width / 2.0
    return np.array((x, y)) + np.stack((along + across, along - across, -along - across, -along + across))


def _outline(picture: Pixels, region: Region, place: Floats, colour: Colour) -> None:
    pixels = region.pixels(_corners(place))
    cv2.fillConvexPoly(picture, pixels, colour, cv2.LINE_AA, _SUBPIXEL_BITS)
    cv2.polylines(picture, [pixels], True, _OUTLINE, 1, cv2.LINE_AA, _SUBPIXEL_BITS)


def _vehicle(picture: Pixels, region: Region, place: Floats, colour: Colour) -> None:
    """Draw a rectangle with a dark wedge that points ahead."""
    _outline(picture, region, place, colour)
    corners = _corners(place)
    nose = (corners[0] + corners[1]) / 2.0
    back = place[:2] + 0.35 * (nose - place[:2])
    half = (corners[0] - corners[1]) * 0.35
    wedge = region.pixels(np.stack((nose, back + half, back - half)))
    cv2.fillConvexPoly(picture, wedge, _OUTLINE, cv2.LINE_AA, _SUBPIXEL_BITS)


def _actor(picture: Pixels, region: Region, actor: Floats, frame: WorldState) -> None:
    kind, state = ActorKind(int(actor[frame.KIND])), ActorState(int(actor[frame.STATE]))
    colour = _FIXED_COLOURS.get(kind, _whole(paint_of(int(actor[frame.ID]))))
    place = actor[[frame.X, frame.Y, frame.YAW, frame.LENGTH, frame.WIDTH]]
    if kind.collision_class == "layout":
        _outline(picture, region, place, colour)
        return
    if kind == ActorKind.PEDESTRIAN:
        middle = region.pixels(place[None, :2])[0]
        radius = max(2, round(0.5 / region.texel_m)) << _SUBPIXEL_BITS
        cv2.circle(picture, _point(middle), radius, colour, -1, cv2.LINE_AA, _SUBPIXEL_BITS)
        cv2.circle(picture, _point(middle), radius, _OUTLINE, 1, cv2.LINE_AA, _SUBPIXEL_BITS)
        return
    _vehicle(picture, region, place, colour)
    rear_right, rear_left = _corners(place)[3], _corners(place)[2]
    if ActorState.BRAKING in state:
        _stroke(picture, region, rear_right, rear_left, (255, 30, 30))
    if ActorState.SIREN in state:
        _stroke(picture, region, (rear_right + rear_left) / 2.0, place[:2], _SIREN)


def _stroke(picture: Pixels, region: Region, start: Floats, end: Floats, colour: Colour) -> None:
    first, last = region.pixels(np.stack((start, end)))
    cv2.line(picture, _point(first), _point(last), colour, 2, cv2.LINE_AA, _SUBPIXEL_BITS)


def _light(picture: Pixels, region: Region, place: tuple[float, float], heading_rad: float, colour: Colour) -> None:
    """Draw a disc at the pole with a tick towards the traffic that must obey it."""
    pole = np.array(place)
    toward = pole - np.array(scalars.cos_sin(heading_rad)) * 2.0
    _stroke(picture, region, pole, toward, _OUTLINE)
    middle = _point(region.pixels(pole[None])[0])
    radius = max(3, round(0.8 / region.texel_m)) << _SUBPIXEL_BITS
    cv2.circle(picture, middle, radius, colour, -1, cv2.LINE_AA, _SUBPIXEL_BITS)
    cv2.circle(picture, middle, radius, _OUTLINE, 1, cv2.LINE_AA, _SUBPIXEL_BITS)


def _point(pixel: NDArray[np.int32]) -> tuple[int, int]:
    return int(pixel[0]), int(pixel[1])
