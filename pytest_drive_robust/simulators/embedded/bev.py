"""The world from above, for people: lanes, markings, route, ego, actors by kind, lights by state."""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from pytest_drive_robust.domain.truth import ActorKind, Frame, Lane, LaneKind, LaneMap, LightState

__all__ = ["draw_bev"]

Floats = NDArray[np.float64]
Picture = NDArray[np.uint8]
Colour = tuple[int, int, int]

_GRASS: Colour = (196, 206, 184)
_GROUND: dict[LaneKind, Colour] = {
    LaneKind.SIDEWALK: (214, 212, 206),
    LaneKind.PARKING: (150, 152, 156),
    LaneKind.DRIVING: (128, 130, 134),
}
_PAINT: Colour = (240, 240, 240)
_BUILDING: Colour = (170, 152, 136)
_ROUTE: Colour = (90, 190, 250)
_EGO: Colour = (20, 90, 220)
_ACTORS: dict[ActorKind, Colour] = {
    ActorKind.EMERGENCY: (250, 250, 250),
    ActorKind.BICYCLE: (150, 60, 190),
    ActorKind.PEDESTRIAN: (230, 60, 160),
    ActorKind.CONE: (240, 120, 20),
    ActorKind.BARRIER: (220, 60, 50),
    ActorKind.CONTAINER: (60, 80, 130),
    ActorKind.WARNING_SIGN: (230, 190, 30),
}
_CAR: Colour = (60, 62, 68)
_LIGHTS: dict[LightState, Colour] = {
    LightState.GREEN: (40, 180, 70),
    LightState.YELLOW: (240, 190, 30),
    LightState.RED: (220, 40, 40),
    LightState.STOP_SIGN: (150, 20, 40),
}
_SHIFT = 4  # cv2 draws at 1/16 of a pixel


@dataclass(frozen=True, slots=True)
class _Canvas:
    """A picture and the map section that it shows: `scale` pixels a metre around (`x_m`, `y_m`); north is up."""

    pixels: Picture
    x_m: float
    y_m: float
    scale: float

    def at(self, points: Floats) -> NDArray[np.int32]:
        """Map points (n, >=2) in metres to cv2's fixed-point pixels (n, 1, 2)."""
        middle = (self.pixels.shape[0] - 1) / 2.0
        place = (points[:, :2] - np.array([self.x_m, self.y_m])) * self.scale + middle
        return np.round(place * (1 << _SHIFT)).astype(np.int32)[:, None, :]

    def fill(self, corners: Floats, colour: Colour) -> None:
        """A convex polygon."""
        cv2.fillConvexPoly(self.pixels, self.at(corners), colour, cv2.LINE_AA, _SHIFT)

    def line(self, points: Floats, colour: Colour, *, width_px: int = 1) -> None:
        """An open polyline."""
        cv2.polylines(self.pixels, [self.at(points)], False, colour, width_px, cv2.LINE_AA, _SHIFT)

    def box(self, x: float, y: float, yaw: float, length: float, width: float, colour: Colour) -> None:
        """An oriented rectangle."""
        self.fill(_corners(x, y, yaw, length, width), colour)


def draw_bev(
    lane_map: LaneMap,
    frame: Frame,
    route: Floats,
    *,
    size_px: int = 512,
    metres: float = 80.0,
    centre: tuple[float, float] | None = None,
    trail: Floats | None = None,
) -> Picture:
    """The section of `metres` x `metres` around the ego (or `centre`), (size_px, size_px, 3) uint8 RGB.

    x (east) points right, y (south) down. `route` is (n, >=2); `trail` the (n, >=2) way that the ego has come.
    """
    x, y = (frame.ego.x_m, frame.ego.y_m) if centre is None else centre
    pixels = np.empty((size_px, size_px, 3), np.uint8)
    pixels[:] = _GRASS
    canvas = _Canvas(pixels, x, y, size_px / metres)
    _draw_ground(canvas, lane_map)
    canvas.line(route, _ROUTE, width_px=max(2, round(0.5 * canvas.scale)))
    if trail is not None and len(trail) > 1:
        canvas.line(trail, _EGO)
    for row in lane_map.buildings:
        canvas.box(*(float(v) for v in row[:5]), _BUILDING)
    _draw_lights(canvas, lane_map, frame)
    for actor in frame.actors:
        _draw_actor(canvas, actor)
    ego = frame.ego
    _draw_vehicle(canvas, ego.x_m, ego.y_m, ego.yaw_rad, ego.length_m, ego.width_m, _EGO)
    return pixels


def _corners(x: float, y: float, yaw: float, length: float, width: float) -> Floats:
    along = np.array([math.cos(yaw), math.sin(yaw)]) * length / 2.0
    beside = np.array([-math.sin(yaw), math.cos(yaw)]) * width / 2.0
    here = np.array([x, y])
    return np.array([here + along + beside, here + along - beside, here - along - beside, here - along + beside])


def _edge(lane: Lane, right_m: float) -> Floats:
    """The lane's centre line, shifted to the right."""
    heading = lane.centre[:, 2]
    return lane.centre[:, :2] + right_m * np.stack([-np.sin(heading), np.cos(heading)], axis=1)


def _draw_ground(canvas: _Canvas, lane_map: LaneMap) -> None:
    for kind, colour in _GROUND.items():
        for lane in lane_map.lanes:
            if lane.kind is kind:
                left, right = _edge(lane, -lane.width_m / 2.0), _edge(lane, lane.width_m / 2.0)
                for k in range(len(left) - 1):
                    canvas.fill(np.array([left[k], left[k + 1], right[k + 1], right[k]]), colour)
    for crosswalk in lane_map.crosswalks:
        canvas.fill(crosswalk, (200, 200, 200))
    for lane in lane_map.lanes:
        for style, right_m in ((lane.left_line, -lane.width_m / 2.0), (lane.right_line, lane.width_m / 2.0)):
            edge = _edge(lane, right_m)
            if style == "solid":
                canvas.line(edge, _PAINT)
            elif style == "striped":
                for k in range(0, len(edge) - 3, 6):
                    canvas.line(edge[k : k + 4], _PAINT)


def _draw_lights(canvas: _Canvas, lane_map: LaneMap, frame: Frame) -> None:
    for line in lane_map.stop_lines:
        colour = _LIGHTS[LightState(int(frame.lights[line.index]))]
        canvas.box(line.x_m, line.y_m, line.heading_rad, 0.8, line.width_m, colour)


def _draw_actor(canvas: _Canvas, actor: Floats) -> None:
    kind = ActorKind(int(actor[Frame.KIND]))
    x, y, yaw, length, width = (float(actor[k]) for k in (Frame.X, Frame.Y, Frame.YAW, Frame.LENGTH, Frame.WIDTH))
    if kind in (ActorKind.CAR, ActorKind.VAN, ActorKind.TRUCK, ActorKind.EMERGENCY):
        _draw_vehicle(canvas, x, y, yaw, length, width, _ACTORS.get(kind, _CAR))
    else:
        # small things are drawn larger than they are, or nobody would find them
        canvas.box(x, y, yaw, max(length, 1.0), max(width, 1.0), _ACTORS.get(kind, _CAR))


def _draw_vehicle(canvas: _Canvas, x: float, y: float, yaw: float, length: float, width: float, colour: Colour) -> None:
    """A box with a light windscreen, so that one sees where it is heading."""
    canvas.box(x, y, yaw, length, width, colour)
    ahead = 0.18 * length
    canvas.box(x + ahead * math.cos(yaw), y + ahead * math.sin(yaw), yaw, 0.16 * length, 0.8 * width, (205, 222, 235))
