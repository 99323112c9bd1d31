"""One moment from above, the ego driving upwards: map, route, actors, lamps, and what the agent means to do."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import cv2
import numpy as np

from pytest_drive_robust.domain.truth import ActorKind, ActorState, LightState, WorldState
from pytest_drive_robust.report.film.canvas import CLEAN, INK, WRONG, Rectangle
from pytest_drive_robust.simulators.embedded.drawing.paint import Region, paint_ground
from pytest_drive_robust.simulators.embedded.drawing.texture import pack_sheet, unpack

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from pytest_drive_robust.domain.agent import PlannedPath
    from pytest_drive_robust.domain.truth import EgoState, LaneMap
    from pytest_drive_robust.report.film.canvas import Colour, Pixels
    from pytest_drive_robust.runner.replay.tape import TapeTick

    Floats = NDArray[np.float64]

__all__ = ["PATH", "ROUTE", "SPEED_POINT", "TARGET_POINT", "GroundPicture", "TopView", "is_misplaced"]

ROUTE: Colour = (178, 160, 255)
PATH: Colour = (255, 40, 40)
TARGET_POINT: Colour = (40, 110, 255)
SPEED_POINT: Colour = (40, 220, 80)
"""Of the plan: as in the paper's figures."""

_MARGIN_M = 75.0
_FINEST_TEXEL_M = 0.15
_MISPLACED_M = 0.3
_MOST_TEXELS = 20e6
_OUTLINE: Colour = (20, 20, 20)
_BITS = 4
_LAMPS: dict[int, Colour] = {
    LightState.GREEN: (40, 220, 80),
    LightState.YELLOW: (255, 210, 40),
    LightState.RED: (255, 50, 50),
    LightState.STOP_SIGN: (200, 20, 28),
}
_COLOURS: dict[ActorKind, Colour] = {
    ActorKind.EMERGENCY: (255, 255, 255),
    ActorKind.BICYCLE: (255, 120, 220),
    ActorKind.PEDESTRIAN: (255, 60, 200),
    ActorKind.CONE: (255, 120, 20),
    ActorKind.BARRIER: (200, 70, 60),
    ActorKind.WARNING_SIGN: (200, 70, 60),
    ActorKind.DOOR: (255, 120, 20),
    ActorKind.BUILDING: (120, 100, 90),
    ActorKind.DIRT: (126, 92, 58),
}
_VEHICLE: Colour = (222, 222, 226)


def is_misplaced(moment: TapeTick) -> bool:
    """Return True when the agent was told a place that is not the ego's."""
    if moment.gps is None:
        return False
    ego = moment.state.ego
    return math.hypot(moment.gps[0] - ego.x_m, moment.gps[1] - ego.y_m) > _MISPLACED_M


class GroundPicture:
    """The map of a film painted once: everything that does not move, 75 m around the route."""

    def __init__(self, lane_map: LaneMap, route: Floats) -> None:
        low, high = route[:, :2].min(axis=0) - _MARGIN_M, route[:, :2].max(axis=0) + _MARGIN_M
        texel_m = max(_FINEST_TEXEL_M, math.sqrt(float(np.prod(high - low)) / _MOST_TEXELS))
        region = Region.around(route[:, :2], _MARGIN_M, texel_m=texel_m)
        pixels = np.ascontiguousarray(unpack(pack_sheet(paint_ground(lane_map, region))))
        for row in lane_map.buildings:
            cv2.fillConvexPoly(pixels, region.pixels(_corners(row[:5])), (120, 100, 90), cv2.LINE_AA, _BITS)
        # only a little brighter than the window: what moves shall stand out
        self.pixels: Pixels = np.asarray(pixels // 2 + 12, np.uint8)
        self.region = region
        self.stop_lines = lane_map.stop_lines
        self.route = route[:, :2]


@dataclass(frozen=True, slots=True)
class TopView:
    """How to look at a moment: where in the picture, pixels per metre, and the share of the height behind the ego."""

    box: Rectangle
    px_per_m: float = 8.0
    behind: float = 0.24

    def draw(
        self,
        picture: Pixels,
        ground: GroundPicture,
        moment: TapeTick,
        *,
        colour: Colour,
        twin: EgoState | None = None,
        marks: Sequence[tuple[float, float]] = (),
    ) -> None:
        """Draw into the box: the ego in `colour`, its clean `twin` as an outline, a ring around each of `marks`.

        `marks` are places of infractions in metres.
        """
        frame = moment.state
        turn = self._turn(frame.ego)
        canvas = self._warped(ground, turn)
        _path(canvas, turn, ground.route, ROUTE, 2)
        for index, line in enumerate(ground.stop_lines):
            state = int(frame.lights[index]) if line.is_light else int(LightState.STOP_SIGN)
            _lamp(canvas, turn, (line.pole_x_m, line.pole_y_m), _LAMPS.get(state, _OUTLINE))
        for actor in frame.actors:
            _actor(canvas, turn, actor, self.px_per_m)
        ego = frame.ego
        place = (ego.x_m, ego.y_m, ego.yaw_rad, ego.length_m, ego.width_m)
        _vehicle(canvas, turn, np.array(place), colour)
        if twin is not None:
            box = np.array((twin.x_m, twin.y_m, twin.yaw_rad, twin.length_m, twin.width_m))
            cv2.polylines(canvas, [_fixed(turn, _corners(box))], True, CLEAN, 2, cv2.LINE_AA, _BITS)
        if moment.gps is not None and is_misplaced(moment):
            _cross(canvas, turn, moment.gps)
        if moment.plan is not None:
            _plan(canvas, turn, moment.plan)
        for mark in marks:
            _ring(canvas, turn, mark)
        self.box.of(picture)[:] = canvas

    def _turn(self, ego: EgoState) -> Floats:
        """Return the matrix (2, 3) from metres of the world to pixels of the box."""
        c, s, k = math.cos(ego.yaw_rad), math.sin(ego.yaw_rad), self.px_per_m
        rotation = np.array(((-s * k, c * k), (-c * k, -s * k)))
        middle = np.array((self.box.width / 2.0, self.box.height * (1.0 - self.behind)))
        return np.column_stack((rotation, middle - rotation @ (ego.x_m, ego.y_m)))

    def _warped(self, ground: GroundPicture, turn: Floats) -> Pixels:
        region = ground.region
        rotation = turn[:, :2] * region.texel_m
        corner = np.array((region.x_m, region.y_m)) + 0.5 * region.texel_m
        texels = np.column_stack((rotation, turn[:, :2] @ corner + turn[:, 2]))
        edge = ground.pixels[0, 0].tolist()
        size = (self.box.width, self.box.height)
        return np.asarray(cv2.warpAffine(ground.pixels, texels, size, flags=cv2.INTER_LINEAR, borderValue=edge))


def _fixed(turn: Floats, points: Floats) -> NDArray[np.int32]:
    """Turn points (n, 2) in metres into OpenCV's fixed-point pixels."""
    pixels = points[:, :2] @ turn[:, :2].T + turn[:, 2]
    return np.asarray(np.round(np.clip(pixels, -2000.0, 4000.0) * (1 << _BITS)), np.int32)


def _corners(place: Floats) -> Floats:
    """Return the corners (4, 2) of a rectangle (x, y, yaw, length, width) from the front right one to the left."""
    x, y, yaw, length, width = (float(value) for value in place)
    along = np.array((math.cos(yaw), math.sin(yaw))) * length / 2.0
    across = np.array((-math.sin(yaw), math.cos(yaw))) * width / 2.0
    return np.array((x, y)) + np.stack((along + across, along - across, -along - across, -along + across))


def _path(canvas: Pixels, turn: Floats, points: Floats, colour: Colour, thickness: int) -> None:
    if len(points) >= 2:
        cv2.polylines(canvas, [_fixed(turn, points)], False, colour, thickness, cv2.LINE_AA, _BITS)


def _vehicle(canvas: Pixels, turn: Floats, place: Floats, colour: Colour) -> None:
    """Draw a rectangle with a dark wedge that points ahead."""
    corners = _corners(place)
    cv2.fillConvexPoly(canvas, _fixed(turn, corners), colour, cv2.LINE_AA, _BITS)
    cv2.polylines(canvas, [_fixed(turn, corners)], True, _OUTLINE, 1, cv2.LINE_AA, _BITS)
    nose = (corners[0] + corners[1]) / 2.0
    back = place[:2] + 0.3 * (nose - place[:2])
    half = (corners[0] - corners[1]) * 0.35
    wedge = np.stack((nose, back + half, back - half))
    cv2.fillConvexPoly(canvas, _fixed(turn, wedge), _OUTLINE, cv2.LINE_AA, _BITS)


def _actor(canvas: Pixels, turn: Floats, actor: Floats, px_per_m: float) -> None:
    kind, state = ActorKind(int(actor[WorldState.KIND])), ActorState(int(actor[WorldState.STATE]))
    colour = _COLOURS.get(kind, _VEHICLE)
    place = actor[[WorldState.X, WorldState.Y, WorldState.YAW, WorldState.LENGTH, WorldState.WIDTH]]
    if kind is ActorKind.PEDESTRIAN:
        middle, radius = _point(turn, (float(place[0]), float(place[1]))), round(0.7 * px_per_m) << _BITS
        cv2.circle(canvas, middle, radius, colour, -1, cv2.LINE_AA, _BITS)
        cv2.circle(canvas, middle, radius, INK, 1, cv2.LINE_AA, _BITS)
        return
    if kind.collision_class == "layout":
        cv2.fillConvexPoly(canvas, _fixed(turn, _corners(place)), colour, cv2.LINE_AA, _BITS)
        return
    _vehicle(canvas, turn, place, colour)
    corners = _corners(place)
    if ActorState.BRAKING in state:
        _path(canvas, turn, corners[2:], (255, 30, 30), 2)
    if ActorState.SIREN in state:
        _path(canvas, turn, np.stack(((corners[2] + corners[3]) / 2.0, place[:2])), (40, 90, 255), 3)


def _plan(canvas: Pixels, turn: Floats, plan: PlannedPath) -> None:
    if plan.path:
        _path(canvas, turn, np.array(plan.path), PATH, 2)
    for points, colour, radius in ((plan.speed_points, SPEED_POINT, 3), (plan.target_points, TARGET_POINT, 5)):
        for point in points:
            cv2.circle(canvas, _point(turn, point), radius << _BITS, colour, -1, cv2.LINE_AA, _BITS)


def _lamp(canvas: Pixels, turn: Floats, pole: tuple[float, float], colour: Colour) -> None:
    cv2.circle(canvas, _point(turn, pole), 5 << _BITS, colour, -1, cv2.LINE_AA, _BITS)
    cv2.circle(canvas, _point(turn, pole), 5 << _BITS, _OUTLINE, 1, cv2.LINE_AA, _BITS)


def _ring(canvas: Pixels, turn: Floats, place: tuple[float, float]) -> None:
    for thickness, colour in ((8, _OUTLINE), (4, WRONG)):
        cv2.circle(canvas, _point(turn, place), 20 << _BITS, colour, thickness, cv2.LINE_AA, _BITS)


def _cross(canvas: Pixels, turn: Floats, place: tuple[float, float]) -> None:
    """Mark where the agent is told that it is."""
    x, y = _point(turn, place)
    arm = 7 << _BITS
    for thickness, paint in ((5, _OUTLINE), (2, INK)):
        cv2.line(canvas, (x - arm, y - arm), (x + arm, y + arm), paint, thickness, cv2.LINE_AA, _BITS)
        cv2.line(canvas, (x - arm, y + arm), (x + arm, y - arm), paint, thickness, cv2.LINE_AA, _BITS)


def _point(turn: Floats, place: tuple[float, float]) -> tuple[int, int]:
    x, y = _fixed(turn, np.array((place,), np.float64))[0]
    return int(x), int(y)
