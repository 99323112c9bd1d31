"""Sun, rain and drops over a finished picture."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from pytest_drive_robust.domain.observation import CameraSpec
from pytest_drive_robust.domain.route import Weather
from pytest_drive_robust.jit.kernels import uncached_entry
from pytest_drive_robust.simulators.embedded.drawing.air import Air
from pytest_drive_robust.simulators.embedded.drawing.canvas import CameraView
from pytest_drive_robust.simulators.embedded.drawing.lens import draw_lens
from pytest_drive_robust.simulators.embedded.weathers import WEATHERS

CAMERA = CameraSpec("front", width_px=160, height_px=96)
SUNSET = Air.of(replace(WEATHERS["clear sunset"], sun_azimuth_angle=0.0))
RAIN = Air.of(WEATHERS["hard rain noon"])
Pixels = NDArray[np.uint8]


@uncached_entry
def draw(image: Pixels, faces: NDArray[np.int32], tick: int, view: CameraView, air: Air) -> None:
    draw_lens(image, faces, tick, view, air)


def drawn(
    air: Air, *, tick: int = 0, yaw_rad: float = 0.0, hidden: bool = False, camera: CameraSpec = CAMERA
) -> Pixels:
    image = np.full((camera.height_px, camera.width_px, 3), 90, np.uint8)
    faces = np.full((camera.height_px, camera.width_px), int(hidden), np.int32)
    draw(image, faces, tick, CameraView.of(camera, 0.0, 0.0, yaw_rad), air)
    return image


def test_a_low_sun_dazzles_who_drives_towards_it() -> None:
    towards, away = drawn(SUNSET), drawn(SUNSET, yaw_rad=np.pi)
    assert towards.max() > 240
    assert (away == 90).all()
    rows, columns = np.nonzero(towards[:, :, 0] > 240)
    assert abs(columns.mean() - 79.5) < 2.0
    assert rows.mean() < 48.0


def test_the_sun_moves_to_the_left_when_the_camera_turns_right() -> None:
    column = drawn(SUNSET, yaw_rad=0.2)[:, :, 0].astype(int).sum(axis=0).argmax()
    assert column < 60


def test_a_sun_behind_a_building_has_no_disc_and_little_glare() -> None:
    seen, hidden = drawn(SUNSET), drawn(SUNSET, hidden=True)
    assert hidden.max() < 200
    assert 90.0 < hidden.mean() < seen.mean()


@pytest.mark.parametrize("name", ["clear noon", "cloudy noon", "clear night", "dust storm"])
def test_fair_noon_night_and_dust_leave_the_picture_alone(name: str) -> None:
    air = Air.of(WEATHERS[name])
    assert air.rain == air.drops == air.glare == 0.0
    assert (drawn(air) == 90).all()


def test_rain_falls_and_heavier_rain_covers_more() -> None:
    assert (drawn(RAIN) != drawn(RAIN, tick=1)).any()
    covered = [(drawn(Air.of(Weather(precipitation=share))) != 90).any(axis=2).mean() for share in (10.0, 40.0, 100.0)]
    assert 0.0 < covered[0] < covered[1] < covered[2] < 0.25


def test_a_drop_stays_at_its_place_while_rain_goes_on() -> None:
    only_drops = RAIN._replace(rain=0.0)
    gradient = np.broadcast_to(np.arange(160, dtype=np.uint8)[None, :, None], (96, 160, 3))

    def with_drops(tick: int) -> Pixels:
        image = gradient.copy()
        draw(image, np.zeros((96, 160), np.int32), tick, CameraView.of(CAMERA, 0.0, 0.0, 0.0), only_drops)
        return image

    first, next_tick, much_later = with_drops(100), with_drops(101), with_drops(700)
    changed = (first != gradient).any(axis=2)
    assert 0.0 < changed.mean() < 0.2
    assert ((first != next_tick).any(axis=2)).mean() < 0.3 * changed.mean()
    assert ((first != much_later).any(axis=2)).mean() > 0.8 * changed.mean()


def test_the_same_tick_gives_the_same_picture() -> None:
    assert (drawn(RAIN, tick=7) == drawn(RAIN, tick=7)).all()


@settings(max_examples=60)
@given(
    st.integers(1, 90),
    st.integers(1, 60),
    st.floats(-4.0, 4.0),
    st.floats(-1.4, 1.4),
    st.floats(20.0, 160.0),
    st.integers(0, 4000),
)
def test_no_camera_is_drawn_outside_of_its_picture(
    width: int, height: int, yaw: float, pitch: float, fov: float, tick: int
) -> None:
    camera = CameraSpec("any", pitch_deg=float(np.degrees(pitch)), fov_deg=fov, width_px=width, height_px=height)
    both = SUNSET._replace(rain=1.0, drops=1.0)
    around = np.full((height + 2, width + 2, 3), 90, np.uint8)
    image = around[1:-1, 1:-1]
    draw(image, np.zeros((height, width), np.int32), tick, CameraView.of(camera, 0.0, 0.0, yaw), both)
    frame = np.ones(around.shape[:2], bool)
    frame[1:-1, 1:-1] = False
    assert (around[frame] == 90).all()
