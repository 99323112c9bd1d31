"""Draw the world from above, for people: static and moving objects, in metres, on a picture that may be rotated."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from pytest_drive_robust.arithmetic import scalars
from pytest_drive_robust.domain.truth import ActorKind, ActorState, EgoState, LaneMap, LightState, StopLine, WorldState
from pytest_drive_robust.jit.arrays import Floats, Pixels
from pytest_drive_robust.simulators.embedded.drawing.looks import paint_of
from pytest_drive_robust.simulators.embedded.drawing.packed import unpack
from pytest_drive_robust.simulators.embedded.drawing.paint import Region, paint_ground, rectangle
from pytest_drive_robust.simulators.embedded.drawing.texture import pack_sheet

Colour = tuple[int, int, int]

BUILDING: Colour = (120, 100, 90)
OUTLINE: Colour = (20, 20, 20)
_EGO: Colour = (40, 230, 240)
_ROUTE: Colour = (60, 130, 255)
_KINDS: dict[ActorKind, Colour] = {
    ActorKind.EMERGENCY: (255, 255, 255),
    ActorKind.BICYCLE: (255, 120, 220),
    ActorKind.PEDESTRIAN: (255, 60, 200),
    ActorKind.CONE: (255, 120, 20),
    ActorKind.BARRIER: (200, 70, 60),
    ActorKind.WARNING_SIGN: (200, 70, 60),
    ActorKind.DOOR: (255, 120, 20),
    ActorKind.BUILDING: BUILDING,
    ActorKind.DIRT: (126, 92, 58),
}
_LAMPS: dict[int, Colour] = {
    LightState.GREEN: (40, 220, 80),
    LightState.YELLOW: (255, 210, 40),
    LightState.RED: (255, 50, 50),
    LightState.STOP_SIGN: (200, 20, 28),
}
_BITS = 4
_LAMP_PX = 5.0
_WALKER_M = 0.6


@dataclass(frozen=True, slots=True)
class Sketch:
    """A picture `pixels` (height, width, 3) uint8 RGB; the affine map `turn` (2, 3) converts world metres to pixels."""

    pixels: Pixels
    turn: Floats

    def fixed(self, points: ArrayLike) -> NDArray[np.int32]:
        """Return points (n, 2 or more) in metres as OpenCV's fixed-point pixels."""
        x, y = np.asarray(points, np.float64)[:, :2].T
        places = np.column_stack([a * x + b * y + shift for a, b, shift in self.turn])
        return np.asarray(np.round(np.clip(places, -8000.0, 8000.0) * (1 << _BITS)), np.int32)

    def point(self, place: ArrayLike) -> tuple[int, int]:
        """Return one place (x, y) as OpenCV's fixed-point pixels."""
        x, y = self.fixed(np.asarray(place)[None])[0]
        return int(x), int(y)

    def line(self, points: ArrayLike, colour: Colour, thick_px: int = 1, *, closed: bool = False) -> None:
        """Draw a line from point to point."""
        if len(np.asarray(points)) >= 2:
            cv2.polylines(self.pixels, [self.fixed(points)], closed, colour, thick_px, cv2.LINE_AA, _BITS)

    def fill(self, points: ArrayLike, colour: Colour) -> None:
        """Fill a convex outline."""
        cv2.fillConvexPoly(self.pixels, self.fixed(points), colour, cv2.LINE_AA, _BITS)

    def disc(self, place: ArrayLike, radius_px: float, colour: Colour, thick_px: int = -1) -> None:
        """Fill a disc, or draw a ring `thick_px` thick."""
        radius = round(radius_px * (1 << _BITS))
        cv2.circle(self.pixels, self.point(place), radius, colour, thick_px, cv2.LINE_AA, _BITS)

    def vehicle(self, place: Floats, colour: Colour) -> None:
        """Draw a rectangle (x, y, yaw, length, width) with a dark wedge that points ahead."""
        corners = rectangle(*place)
        self.fill(corners, colour)
        self.line(corners, OUTLINE, closed=True)
        nose, half = (corners[0] + corners[1]) / 2.0, (corners[0] - corners[1]) * 0.35
        back = place[:2] + 0.3 * (nose - place[:2])
        self.fill(np.stack((nose, back + half, back - half)), OUTLINE)

    def scene(self, stop_lines: tuple[StopLine, ...], state: WorldState, paint: Callable[[int], Colour]) -> None:
        """Draw lights, stop signs and all actors; `paint` gives the colour of an ordinary car by its id."""
        for index, line in enumerate(stop_lines):
            colour = _LAMPS[int(state.lights[index]) if line.is_light else int(LightState.STOP_SIGN)]
            for shown, thick_px in ((colour, -1), (OUTLINE, 1)):
                self.disc((line.pole_x_m, line.pole_y_m), _LAMP_PX, shown, thick_px)
        for actor in state.actors:
            self._actor(actor, paint)

    def _actor(self, actor: Floats, paint: Callable[[int], Colour]) -> None:
        kind, state = ActorKind(int(actor[WorldState.KIND])), ActorState(int(actor[WorldState.STATE]))
        colour = _KINDS[kind] if kind in _KINDS else paint(int(actor[WorldState.ID]))
        place = actor[[WorldState.X, WorldState.Y, WorldState.YAW, WorldState.LENGTH, WorldState.WIDTH]]
        if kind is ActorKind.PEDESTRIAN:
            radius_px = max(2.0, _WALKER_M * scalars.hypot(*self.turn[0, :2]))
            for shown, thick_px in ((colour, -1), (OUTLINE, 1)):
                self.disc(place[:2], radius_px, shown, thick_px)
        elif kind.collision_class == "layout":
            self.fill(rectangle(*place), colour)
        else:
            self.vehicle(place, colour)
            corners = rectangle(*place)
            if ActorState.BRAKING in state:
                self.line(corners[2:], (255, 30, 30), 2)
            if ActorState.SIREN in state:
                self.line(np.stack(((corners[2] + corners[3]) / 2.0, place[:2])), (40, 90, 255), 3)


def footprint(ego: EgoState) -> Floats:
    """Return the ego's x, y, yaw, length, width in metres and radians."""
    return np.array((ego.x_m, ego.y_m, ego.yaw_rad, ego.length_m, ego.width_m))


def ground_picture(lane_map: LaneMap, region: Region) -> Sketch:
    """Draw the static parts of a region: the ground and the houses, x to the right, y down."""
    pixels = np.ascontiguousarray(unpack(pack_sheet(paint_ground(lane_map, region))))
    scale = 1.0 / region.texel_m
    turn = np.array(((scale, 0.0, -region.x_m * scale - 0.5), (0.0, scale, -region.y_m * scale - 0.5)))
    sketch = Sketch(pixels, turn)
    for row in lane_map.buildings:
        sketch.fill(rectangle(*row[:5]), BUILDING)
    return sketch


def draw_bev(
    lane_map: LaneMap,
    state: WorldState,
    route: Floats,
    *,
    size_px: int = 512,
    metres: float = 80.0,
    centre: tuple[float, float] | None = None,
    line_px: int = 1,
) -> Sketch:
    """Draw a square of `metres` around `centre` (None: the ego), `size_px` wide and high, x to the right, y down.

    `route` (n, 2 or more) are points in metres, drawn as a line `line_px` thick.
    """
    x, y = centre if centre is not None else (state.ego.x_m, state.ego.y_m)
    region = Region(x - metres / 2.0, y - metres / 2.0, size_px, size_px, metres / size_px)
    sketch = ground_picture(lane_map, region)
    sketch.line(route, _ROUTE, line_px)
    sketch.scene(lane_map.stop_lines, state, paint_of)
    sketch.vehicle(footprint(state.ego), _EGO)
    return sketch
