"""Street lamps stand beside the roads and light them by night."""

from __future__ import annotations

import math

import numpy as np
import pytest
from camera_scene import lane, town
from numpy.typing import NDArray

from pytest_drive_robust.domain.observation import CameraSpec
from pytest_drive_robust.domain.truth import LaneKind, LaneMap
from pytest_drive_robust.jit.kernels import uncached_entry
from pytest_drive_robust.simulators.embedded.drawing.canvas import CameraView, Canvas
from pytest_drive_robust.simulators.embedded.drawing.furniture import Furniture
from pytest_drive_robust.simulators.embedded.drawing.street_lamps import draw_pools, lamp_boxes, lamp_places

NOTHING = np.zeros((0, 6))
CAMERA = CameraSpec("front", width_px=160, height_px=96)


@uncached_entry
def light(canvas: Canvas, places: NDArray[np.float64], view: CameraView, haze_per_m: float, strength: float) -> None:
    draw_pools(canvas, places, view, haze_per_m, strength)


def grey(level: int) -> Canvas:
    canvas = Canvas.of(160, 96)
    canvas.colours[:] = level * 0x010101
    return canvas


def road(*lanes: object) -> LaneMap:
    return LaneMap("Hand", lanes, (), np.zeros((0, 4, 2)), NOTHING)  # type: ignore[arg-type]


def test_no_lamp_stands_on_a_lane() -> None:
    lane_map = town()
    places = lamp_places(lane_map)
    assert len(places) >= 6
    for each in lane_map.lanes:
        if each.kind != LaneKind.SIDEWALK:
            away = np.hypot(*(each.centre[:, None, :2] - places[None, :, :2]).transpose(2, 0, 1)).min(axis=0)
            assert (away > each.width_m / 2.0).all()


def test_a_straight_road_has_one_every_30_m_on_its_right_beyond_the_parking() -> None:
    driving = lane(0, (0, 0), (120, 0), right=1)
    parking = lane(1, (0, 3), (120, 3), kind=LaneKind.PARKING, width=2.5)
    places = lamp_places(road(driving, parking))
    assert np.allclose(places[:, 0], [12.0, 42.0, 72.0, 102.0], atol=1.01)
    assert (places[:, 1] > 3.0 + 1.25).all()
    assert np.allclose(places[:, 2], -math.pi / 2.0)


def test_inner_lanes_and_junctions_have_none() -> None:
    inner = lane(0, (0, 0), (100, 0), right=1)
    outer = lane(1, (0, 3.5), (100, 3.5))
    junction = lane(2, (0, 40), (100, 40), junction=True)
    assert set(np.sign(lamp_places(road(inner, outer, junction))[:, 1] - 3.5)) == {1.0}
    assert len(lamp_places(road(junction))) == 0
    assert lamp_places(road()).shape == (0, 3)


def test_heads_glow_by_night_only() -> None:
    places = lamp_places(town())
    for night in (0.0, 1.0):
        boxes = lamp_boxes(places, night=night)
        assert len(boxes) == 3 * len(places)
        assert sum(box.glow for box in boxes) == night * len(places)
    assert len(Furniture.of(town(), night=1.0).street_lamps) == len(places)


def test_a_lamp_lights_the_road_below_it_and_nothing_that_hides_it() -> None:
    places = np.array(((15.0, 5.0, -math.pi / 2.0),))
    view = CameraView.of(CAMERA, 0.0, 0.0, 0.0)
    canvas = grey(20)
    canvas.faces[:, :60] = 1
    light(canvas, places, view, 0.002, 1.0)
    assert (canvas.colours[:48] == 0x141414).all()
    assert (canvas.colours[:, :60] == 0x141414).all()
    red, green, blue = ((canvas.colours[48:] >> shift & 255).astype(int) for shift in (0, 8, 16))
    assert (red >= green).all()
    assert (green >= blue).all()
    assert blue.max() > 30
    lit = red
    row, column = np.unravel_index(lit.argmax(), lit.shape)
    assert lit.max() > 50
    assert abs((48 + row) - (48 + view.focal_px * 1.6 / 14.2)) < 4.0
    assert abs(column - (80 + view.focal_px * 3.4 / 14.2)) < 8.0


def test_what_is_bright_already_does_not_burn_out() -> None:
    places = np.array(((15.0, 5.0, -math.pi / 2.0),))
    canvas = grey(200)
    light(canvas, places, CameraView.of(CAMERA, 0.0, 0.0, 0.0), 0.002, 1.0)
    assert (canvas.colours == 0xC8C8C8).all()


def test_a_camera_straight_above_sees_the_pools_before_and_behind_it() -> None:
    above = CameraSpec("above", width_px=160, height_px=96, z_m=50.0, pitch_deg=-90.0, fov_deg=50.0)
    view = CameraView.of(above, 0.0, 0.0, 0.0)
    lit = []
    for x, y in ((11.0, 0.0), (-11.0, 0.0), (-11.0, 12.0), (-11.0, -12.0)):
        canvas = grey(20)
        light(canvas, np.array(((view.x_m + x, y + 1.6, -math.pi / 2.0),)), view, 0.002, 1.0)
        red = (canvas.colours & 255).astype(int)
        assert red.max() > 50, (x, y)
        row, column = np.unravel_index(red.argmax(), red.shape)
        per_m = view.focal_px / 50.0
        assert (row, column) == pytest.approx((47.5 - x * per_m, 79.5 + y * per_m), abs=3.0)  # ahead is up
        lit.append(int((red > 20).sum()))
    assert max(lit) < 1.1 * min(lit)
