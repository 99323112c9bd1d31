"""Draws one moment from above, with the ego driving upwards: map, route, actors, lamps, and the agent's plan."""

from __future__ import annotations

import math
from collections.abc import Sequence

import cv2
import numpy as np

from pytest_drive_robust.domain.agent import PlannedPath
from pytest_drive_robust.domain.truth import EgoState, LaneMap
from pytest_drive_robust.jit.arrays import Floats, Pixels
from pytest_drive_robust.report.film.canvas import CLEAN, INK, WRONG, Colour, Rectangle
from pytest_drive_robust.runner.replay.recording import TapedMoment
from pytest_drive_robust.simulators.embedded.bev import OUTLINE, Sketch, footprint, ground_picture
from pytest_drive_robust.simulators.embedded.drawing.paint import Region, rectangle

ROUTE: Colour = (178, 160, 255)
PATH: Colour = (255, 40, 40)
TARGET_POINT: Colour = (40, 110, 255)
SPEED_POINT: Colour = (40, 220, 80)
"""The colours of the plan are those of the paper's figures."""

_PX_PER_M = 8.0
_BEHIND = 0.24
"""The share of the height that lies behind the ego."""
_MARGIN_M = 75.0
_FINEST_TEXEL_M = 0.15
_MISPLACED_M = 0.3
_MOST_TEXELS = 20e6
_BITS = 4
_VEHICLE: Colour = (222, 222, 226)


def misplaced_m(moment: TapedMoment) -> float:
    """Return how far from the ego the location is that the agent was given, in metres; 0 up to 0.3 m."""
    if moment.gps is None:
        return 0.0
    ego = moment.state.ego
    off_m = math.hypot(moment.gps[0] - ego.x_m, moment.gps[1] - ego.y_m)
    return off_m if off_m > _MISPLACED_M else 0.0


class GroundPicture:
    """The ground of a film, painted once: everything that does not move, up to 75 m around the route."""

    def __init__(self, lane_map: LaneMap, route: Floats) -> None:
        low, high = route[:, :2].min(axis=0) - _MARGIN_M, route[:, :2].max(axis=0) + _MARGIN_M
        texel_m = max(_FINEST_TEXEL_M, math.sqrt(float(np.prod(high - low)) / _MOST_TEXELS))
        region = Region.around(route[:, :2], _MARGIN_M, texel_m=texel_m)
        # dimmed, so that moving things stand out
        self.pixels: Pixels = np.asarray(ground_picture(lane_map, region).pixels // 2 + 12, np.uint8)
        self.region = region
        self.stop_lines = lane_map.stop_lines
        self.route = route[:, :2]


def draw_from_above(
    picture: Pixels,
    box: Rectangle,
    ground: GroundPicture,
    moment: TapedMoment,
    *,
    colour: Colour,
    twin: EgoState | None,
    marks: Sequence[tuple[float, float]],
    ahead: Sequence[tuple[float, float]],
) -> None:
    """Draw a moment into the box: the ego in `colour`, its clean `twin` as an outline, a ring around each of `marks`.

    `marks` are places of infractions in metres; those that are still to come, `ahead`, have a broken ring.
    """
    ego = moment.state.ego
    turn = _turn(box, ego)
    sketch = Sketch(_warped(box, ground, turn), turn)
    sketch.line(ground.route, ROUTE, 2)
    sketch.scene(ground.stop_lines, moment.state, lambda _: _VEHICLE)
    sketch.vehicle(footprint(ego), colour)
    if twin is not None:
        sketch.line(rectangle(*footprint(twin)), CLEAN, 2, closed=True)
    if moment.gps is not None and misplaced_m(moment):
        _cross(sketch, moment.gps)
    if moment.plan is not None:
        _plan(sketch, moment.plan)
    for mark in ahead:
        _broken_ring(sketch, mark)
    for mark in marks:
        for thickness, shown in ((8, OUTLINE), (4, WRONG)):
            sketch.disc(mark, 20, shown, thickness)
    box.of(picture)[:] = sketch.pixels


def _turn(box: Rectangle, ego: EgoState) -> Floats:
    """Return the matrix (2, 3) from metres of the world to pixels of the box."""
    c, s, k = math.cos(ego.yaw_rad), math.sin(ego.yaw_rad), _PX_PER_M
    rotation = np.array(((-s * k, c * k), (-c * k, -s * k)))
    middle = np.array((box.width / 2.0, box.height * (1.0 - _BEHIND)))
    return np.column_stack((rotation, middle - rotation @ (ego.x_m, ego.y_m)))


def _warped(box: Rectangle, ground: GroundPicture, turn: Floats) -> Pixels:
    region = ground.region
    rotation = turn[:, :2] * region.texel_m
    corner = np.array((region.x_m, region.y_m)) + 0.5 * region.texel_m
    texels = np.column_stack((rotation, turn[:, :2] @ corner + turn[:, 2]))
    edge = ground.pixels[0, 0].tolist()
    size = (box.width, box.height)
    return np.asarray(cv2.warpAffine(ground.pixels, texels, size, flags=cv2.INTER_LINEAR, borderValue=edge))


def _plan(sketch: Sketch, plan: PlannedPath) -> None:
    sketch.line(plan.path, PATH, 2)
    for points, colour, radius in ((plan.speed_points, SPEED_POINT, 3), (plan.target_points, TARGET_POINT, 5)):
        for point in points:
            sketch.disc(point, radius, colour)


def _broken_ring(sketch: Sketch, place: tuple[float, float]) -> None:
    radius = (20 << _BITS, 20 << _BITS)
    for thickness, paint in ((5, OUTLINE), (2, WRONG)):
        for angle in range(0, 360, 45):
            cv2.ellipse(
                sketch.pixels, sketch.point(place), radius, 0, angle, angle + 25, paint, thickness, cv2.LINE_AA, _BITS
            )


def _cross(sketch: Sketch, place: tuple[float, float]) -> None:
    """Draw a cross at the location that the agent was given."""
    x, y = sketch.point(place)
    arm = 7 << _BITS
    for thickness, paint in ((5, OUTLINE), (2, INK)):
        cv2.line(sketch.pixels, (x - arm, y - arm), (x + arm, y + arm), paint, thickness, cv2.LINE_AA, _BITS)
        cv2.line(sketch.pixels, (x - arm, y + arm), (x + arm, y - arm), paint, thickness, cv2.LINE_AA, _BITS)
