"""Cameras show what the scene holds: where it is, behind what, in which light."""

from __future__ import annotations

import hashlib
import math
import os
import subprocess
import sys
from dataclasses import replace

import cv2
import numpy as np
import pytest
from camera_scene import actor, around, busy_frame, frame, town, without
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from pytest_drive_robust.domain.observation import CameraSpec
from pytest_drive_robust.domain.route import Weather
from pytest_drive_robust.domain.truth import ActorKind, ActorState, LightState, WorldState
from pytest_drive_robust.simulators.embedded.bev import draw_bev
from pytest_drive_robust.simulators.embedded.camera import CameraRig

FRONT = CameraSpec("front")
CLEAR = Weather(sun_altitude_angle=60.0)
NIGHT = Weather(sun_altitude_angle=-30.0)
OPEN_TOWN = town(buildings=False)
Pixels = NDArray[np.uint8]
Mask = NDArray[np.bool_]


def picture(
    shown: WorldState, *, camera: CameraSpec = FRONT, weather: Weather = CLEAR, lane_map: object = None
) -> Pixels:
    rig = CameraRig(lane_map or OPEN_TOWN, weather, [camera], around=around())  # type: ignore[arg-type]
    return rig.render(shown)[camera.name].copy()


def actor_mask(shown: WorldState, number: int, *, camera: CameraSpec = FRONT, lane_map: object = None) -> Mask:
    """Where the actor of that id is seen."""
    rig = CameraRig(lane_map or OPEN_TOWN, CLEAR, [camera], around=around())  # type: ignore[arg-type]
    found: Mask = rig.actors_seen(shown)[camera.name] == number
    return found


def project(x: float, y: float, z: float, shown: WorldState, camera: CameraSpec) -> tuple[float, float]:
    """Pinhole projection by hand: column and row of a point in the world."""
    ego, yaw = shown.ego, shown.ego.yaw_rad + math.radians(camera.yaw_deg)
    cx = ego.x_m + camera.x_m * math.cos(ego.yaw_rad) - camera.y_m * math.sin(ego.yaw_rad)
    cy = ego.y_m + camera.x_m * math.sin(ego.yaw_rad) + camera.y_m * math.cos(ego.yaw_rad)
    forward = (x - cx) * math.cos(yaw) + (y - cy) * math.sin(yaw)
    right = -(x - cx) * math.sin(yaw) + (y - cy) * math.cos(yaw)
    focal = camera.width_px / 2.0 / math.tan(math.radians(camera.fov_deg) / 2.0)
    return camera.width_px / 2.0 + focal * right / forward, camera.height_px / 2.0 + focal * (camera.z_m - z) / forward


def corners_of(row: list[float], shown: WorldState, camera: CameraSpec) -> list[tuple[float, float]]:
    """Columns and rows of the eight corners of an actor's box."""
    x, y, yaw, length, width, height = row[2], row[3], row[4], row[6], row[7], row[8]
    return [
        project(
            x + a * length / 2 * math.cos(yaw) - b * width / 2 * math.sin(yaw),
            y + a * length / 2 * math.sin(yaw) + b * width / 2 * math.cos(yaw),
            z,
            shown,
            camera,
        )
        for a in (-1, 1)
        for b in (-1, 1)
        for z in (0.0, height)
    ]


def box_of(row: list[float], shown: WorldState, camera: CameraSpec) -> tuple[float, float, float, float]:
    """(left, top, right, bottom) of an actor's box in the picture."""
    columns, rows = zip(*corners_of(row, shown, camera), strict=True)
    return min(columns), min(rows), max(columns), max(rows)


def changed(one: Pixels, other: Pixels) -> NDArray[np.bool_]:
    found: NDArray[np.bool_] = np.abs(one.astype(int) - other.astype(int)).max(axis=2) > 12
    return found


@pytest.mark.parametrize(
    "camera", [FRONT, CameraSpec("wide", fov_deg=110.0, width_px=320, height_px=160, yaw_deg=20.0)]
)
@pytest.mark.parametrize(
    ("kind", "x", "y", "yaw", "least"),
    [
        (ActorKind.CAR, 14.0, 1.75, 0.0, 0.8),
        (ActorKind.CAR, 22.0, 4.0, 0.6, 0.8),
        (ActorKind.VAN, 20.0, 5.5, 0.4, 0.8),
        (ActorKind.CONTAINER, 18.0, 6.0, 0.0, 0.9),
        (ActorKind.TRUCK, 25.0, -1.75, math.pi, 0.8),
        (ActorKind.PEDESTRIAN, 10.0, 3.0, 0.0, 0.7),
        (ActorKind.PEDESTRIAN, 10.0, 3.0, 1.57, 0.45),  # half as deep as its box
        (ActorKind.BARRIER, 9.0, 3.0, 1.2, 0.7),
    ],
)
def test_an_actor_fills_the_box_that_geometry_predicts(
    kind: ActorKind, x: float, y: float, yaw: float, least: float, camera: CameraSpec
) -> None:
    row = actor(kind, x, y, yaw=yaw, number=4)
    shown = frame(row)
    rows, columns = np.nonzero(actor_mask(shown, 4, camera=camera))
    left, top, right, bottom = box_of(row, shown, camera)
    seen = (columns.min(), rows.min(), columns.max() + 1, rows.max() + 1)
    overlap = max(0.0, min(right, seen[2]) - max(left, seen[0])) * max(0.0, min(bottom, seen[3]) - max(top, seen[1]))
    union = (right - left) * (bottom - top) + (seen[2] - seen[0]) * (seen[3] - seen[1]) - overlap
    assert overlap / union >= least


def test_a_box_covers_the_hull_of_its_corners_and_nothing_else() -> None:
    row = actor(ActorKind.BUILDING, 30.0, 8.0, yaw=0.5, number=4)
    shown = frame(row)
    hull = cv2.convexHull(np.array(corners_of(row, shown, FRONT), np.float32)).reshape(-1, 2)
    middles = ((column + 0.5, line + 0.5) for line in range(144) for column in range(256))
    inside = np.array([cv2.pointPolygonTest(hull, middle, True) for middle in middles]).reshape(144, 256)
    mask = actor_mask(shown, 4)
    assert mask[inside > 0.01].all()
    assert not mask[inside < -0.01].any()
    assert mask.sum() > 1000


def test_right_is_right() -> None:
    on_the_right = changed(picture(frame(actor(ActorKind.CAR, 15.0, 6.0))), picture(frame()))
    columns = np.nonzero(on_the_right)[1]
    assert columns.min() > FRONT.width_px / 2


def test_what_is_behind_a_box_is_not_seen() -> None:
    wall = actor(ActorKind.TRUCK, 14.0, 1.75, yaw=math.pi / 2, number=1)
    hidden = actor(ActorKind.PEDESTRIAN, 18.0, 1.75, number=2)
    assert not changed(picture(frame(wall, hidden)), picture(frame(wall))).any()
    assert changed(picture(frame(hidden)), picture(frame())).any()


def test_what_is_behind_a_building_is_not_seen() -> None:
    with_buildings = town()
    x, y, _, _, width, _ = with_buildings.buildings[0]
    ego = {"x": float(x), "y": 1.75, "yaw": math.copysign(math.pi / 2, y)}
    behind = actor(ActorKind.CAR, float(x), float(y + math.copysign(width / 2 + 4.0, y)), number=3)
    assert not actor_mask(frame(behind, **ego), 3, lane_map=with_buildings).any()
    assert actor_mask(frame(behind, **ego), 3).any()
    assert not changed(
        picture(frame(behind, **ego), lane_map=with_buildings), picture(frame(**ego), lane_map=with_buildings)
    ).any()


def test_the_nearer_of_two_cars_hides_the_other_whatever_their_order() -> None:
    near = actor(ActorKind.CAR, 12.0, 1.75, number=1)
    far = actor(ActorKind.CAR, 17.0, 1.75, number=2)
    assert np.array_equal(picture(frame(near, far)), picture(frame(far, near)))
    alone, behind = actor_mask(frame(far), 2), actor_mask(frame(near, far), 2)
    assert 0 < behind.sum() < alone.sum()
    assert not (behind & ~alone).any()
    assert np.array_equal(actor_mask(frame(near, far), 1), actor_mask(frame(near), 1))


@pytest.mark.parametrize("sun", [60.0, 3.0, -30.0])
def test_a_light_shows_its_colour_forty_metres_away(sun: float) -> None:
    line = next(line for line in OPEN_TOWN.stop_lines if line.is_light and math.cos(line.heading_rad) > 0.9)
    shown = {"x": line.pole_x_m - 40.0, "y": line.y_m}
    column, row = project(line.pole_x_m, line.pole_y_m, 4.0, frame(**shown), FRONT)
    found = {}
    for state in (LightState.RED, LightState.YELLOW, LightState.GREEN):
        lights = [LightState.GREEN] * len(OPEN_TOWN.stop_lines)
        lights[line.index] = state
        image = picture(
            frame(lights=tuple(lights), **shown), weather=Weather(sun_altitude_angle=sun, sun_azimuth_angle=180.0)
        )
        spot = image[int(row) - 8 : int(row) + 9, int(column) - 5 : int(column) + 6].reshape(-1, 3).astype(int)
        red, green = spot[:, 0] > 150, spot[:, 1] > 150
        found[state] = (
            int((red & (spot[:, 1] < 110)).sum()),
            int((red & green & (spot[:, 2] < 110)).sum()),
            int((green & (spot[:, 0] < 110)).sum()),
        )
    for place, state in enumerate(found):
        assert found[state][place] >= 2
        assert sum(found[state]) == found[state][place]


def test_braking_makes_the_rear_lamps_brighter() -> None:
    def red(state: ActorState) -> int:
        image = picture(frame(actor(ActorKind.CAR, 12.0, 1.75, number=5, state=state))).astype(int)
        return int(np.maximum(image[:, :, 0] - image[:, :, 1], 0).sum())

    assert red(ActorState.BRAKING) > red(ActorState.NONE) + 500


def test_night_is_darker_than_day_and_fog_hides_the_distance() -> None:
    far = frame(actor(ActorKind.CAR, 60.0, 1.75))
    day, night = picture(far), picture(far, weather=NIGHT)
    assert night.mean() < 0.6 * day.mean()
    fog = Weather(fog_density=80.0)
    assert changed(picture(far), picture(frame())).any()
    contrast_day = np.abs(picture(far).astype(int) - picture(frame()).astype(int)).sum()
    contrast_fog = np.abs(picture(far, weather=fog).astype(int) - picture(frame(), weather=fog).astype(int)).sum()
    assert contrast_fog < 0.5 * contrast_day


def test_a_camera_that_looks_back_sees_what_is_behind() -> None:
    back = CameraSpec("back", x_m=-2.0, yaw_deg=180.0)
    behind = frame(actor(ActorKind.CAR, -14.0, 1.75), x=0.0)
    assert changed(picture(behind, camera=back), picture(frame(), camera=back)).any()
    assert not changed(picture(behind), picture(frame())).any()


def test_the_bird_s_eye_view_and_the_camera_agree_on_who_is_there() -> None:
    shown, seen_by_camera = busy_frame(), 0
    for row in shown.actors:
        kind, rest = ActorKind(int(row[WorldState.KIND])), without(shown, int(row[WorldState.ID]))
        dx, dy = row[WorldState.X] - shown.ego.x_m, row[WorldState.Y] - shown.ego.y_m
        if math.hypot(dx, dy) > 35.0:
            continue
        above = draw_bev(OPEN_TOWN, shown, around()).pixels != draw_bev(OPEN_TOWN, rest, around()).pixels
        assert above.any(), kind
        if dx > 4.0 and abs(math.atan2(dy, dx)) < math.radians(30.0):
            seen_by_camera += 1
            assert changed(picture(shown), picture(rest)).any(), kind
    assert seen_by_camera >= 5


def test_inputs_are_not_written_to() -> None:
    shown = busy_frame()
    shown.actors.setflags(write=False)
    shown.lights.setflags(write=False)
    picture(shown)


def test_other_pictures_before_change_nothing() -> None:
    fresh = picture(busy_frame())
    rig = CameraRig(OPEN_TOWN, CLEAR, [FRONT, CameraSpec("left", yaw_deg=-55.0)], around=around())
    rig.render(frame(x=20.0, yaw=0.5))
    rig.render(busy_frame(tick=9), {"left"})
    assert np.array_equal(rig.render(busy_frame())["front"], fresh)


def digests() -> list[str]:
    weathers = (CLEAR, NIGHT, Weather(precipitation=80.0, fog_density=40.0))
    drawn = (picture(busy_frame(3), weather=weather, lane_map=town()) for weather in weathers)
    return [hashlib.blake2b(image).hexdigest() for image in drawn]


def test_another_process_draws_the_same_bytes() -> None:
    here = os.path.dirname(__file__)
    code = f"import sys; sys.path[:0] = {[here, *sys.path]!r}; import test_camera as t; print(t.digests())"
    fresh = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True, text=True, check=True, env={**os.environ, "PYTHONHASHSEED": "5"},
    )  # fmt: skip
    assert fresh.stdout.strip() == str(digests())


@pytest.mark.parametrize("sizes", [[(1, 1)], [(33, 17), (256, 144)], [(64 + k, 31 + k) for k in range(8)]])
def test_any_number_of_cameras_of_any_size(sizes: list[tuple[int, int]]) -> None:
    rig = [
        CameraSpec(f"camera {k}", yaw_deg=45.0 * k, width_px=width, height_px=height)
        for k, (width, height) in enumerate(sizes)
    ]
    pictures = CameraRig(town(), CLEAR, rig, around=around()).render(busy_frame())
    assert [pictures[camera.name].shape for camera in rig] == [(height, width, 3) for width, height in sizes]


@settings(max_examples=60)
@given(
    x=st.floats(-60, 120),
    y=st.floats(-40, 40),
    yaw=st.floats(-7, 7),
    pitch=st.floats(-60, 60),
    fov=st.floats(20, 150),
    near=st.floats(-1.5, 1.5),
)
def test_no_pose_breaks_it(x: float, y: float, yaw: float, pitch: float, fov: float, near: float) -> None:
    camera = replace(FRONT, pitch_deg=pitch, fov_deg=fov, width_px=48, height_px=40)
    image = picture(
        frame(actor(ActorKind.TRUCK, x + near, y + near), x=x, y=y, yaw=yaw), camera=camera, lane_map=town()
    )
    assert image.shape == (40, 48, 3)
    assert image.dtype == np.uint8


@pytest.mark.parametrize("kind", ActorKind)
def test_every_kind_is_told_by_its_id(kind: ActorKind) -> None:
    assert actor_mask(frame(actor(kind, 9.0, 1.75, number=12)), 12).sum() >= 20


def test_who_is_seen_depends_on_no_weather_and_on_no_picture_before() -> None:
    rig = CameraRig(OPEN_TOWN, NIGHT, [FRONT], around=around())
    rig.render(frame(x=20.0, yaw=0.5))
    clear = CameraRig(OPEN_TOWN, CLEAR, [FRONT], around=around())
    assert np.array_equal(rig.actors_seen(busy_frame())["front"], clear.actors_seen(busy_frame())["front"])
    assert np.array_equal(rig.render(busy_frame())["front"], picture(busy_frame(), weather=NIGHT))
