"""Class, distance and actor by pixel: the same geometry as the picture."""

from __future__ import annotations

import hashlib
import math
import os
import subprocess
import sys

import numpy as np
import pytest
from camera_scene import actor, around, busy_frame, frame, town
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from pytest_drive_robust.domain.observation import CameraSpec
from pytest_drive_robust.domain.route import Weather
from pytest_drive_robust.domain.truth import ActorKind, WorldState
from pytest_drive_robust.errors import UnknownNameError
from pytest_drive_robust.simulators.embedded.camera import PASSES, CameraRig
from pytest_drive_robust.simulators.embedded.semantics import CLASS_OF_KIND, SemanticClass

FRONT = CameraSpec("front")
CLEAR = Weather(sun_altitude_angle=60.0)
GROUND = (SemanticClass.ROAD, SemanticClass.ROAD_LINE, SemanticClass.SIDEWALK, SemanticClass.TERRAIN)
TOWN, OPEN_TOWN = town(), town(buildings=False)
FOCAL_PX = 128.0 / math.tan(math.radians(35.0))


def passes(
    shown: WorldState, *names: str, lane_map: object = OPEN_TOWN, camera: CameraSpec = FRONT
) -> dict[str, NDArray]:
    rig = CameraRig(lane_map, CLEAR, [camera], around=around())  # type: ignore[arg-type]
    return dict(rig.render_passes(shown, names or PASSES)[camera.name])


def test_shapes_and_types_are_as_documented() -> None:
    found = passes(busy_frame())
    assert {name: (array.shape, array.dtype.name) for name, array in found.items()} == {
        "rgb": ((144, 256, 3), "uint8"),
        "semantic": ((144, 256), "uint8"),
        "depth": ((144, 256), "float32"),
        "instance": ((144, 256), "int32"),
    }


def test_only_what_was_asked_for_comes_back_and_it_is_the_same() -> None:
    everything = passes(busy_frame())
    for name in PASSES:
        alone = passes(busy_frame(), name)
        assert list(alone) == [name]
        assert np.array_equal(alone[name], everything[name])
    rig = CameraRig(OPEN_TOWN, CLEAR, [FRONT], around=around())
    assert np.array_equal(rig.render(busy_frame())["front"], everything["rgb"])


def test_an_unknown_pass_gets_the_nearest_name() -> None:
    with pytest.raises(UnknownNameError, match="Did you mean 'depth'"):
        passes(busy_frame(), "dept")


def test_the_depth_of_flat_ground_follows_from_the_row() -> None:
    found = passes(frame(), "depth", "semantic")
    ground = np.isin(found["semantic"], GROUND)
    expected = FOCAL_PX * 1.6 / (np.arange(144) + 0.5 - 72.0)
    assert np.allclose(found["depth"][ground], np.broadcast_to(expected[:, None], (144, 256))[ground], rtol=1e-5)
    assert ground[72:].mean() > 0.9
    assert not ground[:72].any()
    assert (np.isinf(found["depth"]) == (found["semantic"] == SemanticClass.SKY)).all()


@pytest.mark.parametrize("yaw_deg", [0.0, 30.0])
def test_the_depth_of_a_wall_is_its_distance_along_the_optical_axis(yaw_deg: float) -> None:
    wall = actor(ActorKind.CONTAINER, 20.0, 1.75, yaw=math.pi / 2, number=7)  # its side is at x = 18.8
    camera = CameraSpec("front", yaw_deg=yaw_deg)
    found = passes(frame(wall), "depth", "instance", camera=camera)
    columns = np.nonzero(found["instance"][70] == 7)[0][2:-2]
    right = (columns + 0.5 - 128.0) / FOCAL_PX
    yaw = math.radians(yaw_deg)
    expected = (18.8 - 0.8) / (math.cos(yaw) - right * math.sin(yaw))
    assert len(columns) > 10
    assert np.allclose(found["depth"][70, columns], expected, rtol=1e-3)


@settings(max_examples=30, deadline=None)
@given(x=st.floats(6.0, 60.0), y=st.floats(-6.0, 6.0), yaw=st.floats(-3.2, 3.2), kind=st.sampled_from(ActorKind))
def test_every_pixel_of_an_actor_is_within_its_box(x: float, y: float, yaw: float, kind: ActorKind) -> None:
    row = actor(kind, x, y, yaw=yaw, number=3)
    found = passes(frame(row), "depth", "instance")
    lines, columns = np.nonzero(found["instance"] == 3)
    depth = found["depth"][lines, columns].astype(np.float64)
    ahead, aside = 0.8 + depth - x, 1.75 + (columns + 0.5 - 128.0) / FOCAL_PX * depth - y
    up = 1.6 - (lines + 0.5 - 72.0) / FOCAL_PX * depth
    length, width, height = row[6:9]
    slack = 0.12 + 1.5 * depth / FOCAL_PX  # lamps stick out; thin parts are at least a pixel wide
    assert (np.abs(ahead * math.cos(yaw) + aside * math.sin(yaw)) < 0.5 * length + slack).all()
    assert (np.abs(aside * math.cos(yaw) - ahead * math.sin(yaw)) < 0.5 * width + slack).all()
    assert (up > -slack).all()
    assert (up < 1.7 * height + slack).all()  # dirt is heaped up


@pytest.mark.parametrize("kind", ActorKind)
def test_every_kind_has_its_class_and_its_id(kind: ActorKind) -> None:
    found = passes(frame(actor(kind, 9.0, 1.75, number=12)), "semantic", "instance")
    mine = found["instance"] == 12
    assert mine.sum() >= 20
    assert set(np.unique(found["semantic"][mine])) == {CLASS_OF_KIND[kind]}


def test_the_ground_has_the_classes_of_the_map() -> None:
    found = passes(frame(), "semantic", "depth", "instance")
    assert (found["instance"] == -1).all()
    semantic = found["semantic"]
    assert (semantic[np.isinf(found["depth"])] == SemanticClass.SKY).all()

    def at(ahead: float, right: float) -> int:
        depth = ahead - 0.8
        return int(semantic[int(72.0 + FOCAL_PX * 1.6 / depth), int(128.0 + FOCAL_PX * right / depth)])

    places = {(12.0, 0.0): SemanticClass.ROAD, (12.0, 3.0): SemanticClass.ROAD, (14.0, 5.5): SemanticClass.SIDEWALK}
    assert {place: at(*place) for place in places} == places
    assert at(25.0, 11.0) == SemanticClass.TERRAIN
    lines = semantic[74:110] == SemanticClass.ROAD_LINE
    assert lines.any(axis=1).mean() > 0.8  # also far away


def test_lights_signs_and_houses_have_their_classes() -> None:
    seen = np.unique(passes(frame(x=5.0, y=1.75), "semantic", lane_map=TOWN)["semantic"])
    assert {SemanticClass.TRAFFIC_LIGHT, SemanticClass.POLE, SemanticClass.BUILDING} <= set(seen)
    sign = next(line for line in TOWN.stop_lines if not line.is_light)
    facing = frame(x=sign.pole_x_m, y=sign.pole_y_m - 10.0, yaw=sign.heading_rad)
    assert (passes(facing, "semantic")["semantic"] == SemanticClass.TRAFFIC_SIGN).sum() > 50


def test_passes_do_not_depend_on_the_weather() -> None:
    names = ("semantic", "depth", "instance")
    found = [
        CameraRig(TOWN, weather, [FRONT], around=around()).render_passes(busy_frame(), names)["front"]
        for weather in (CLEAR, Weather(sun_altitude_angle=-30.0, fog_density=90.0, precipitation=100.0))
    ]
    for name in names:
        assert np.array_equal(found[0][name], found[1][name])


def test_cameras_that_are_not_due_are_left_out() -> None:
    rig = CameraRig(TOWN, CLEAR, [FRONT, CameraSpec("left", yaw_deg=-55.0)], around=around())
    assert list(rig.render_passes(busy_frame(), ("depth",), due={"left"})) == ["left"]


def digests() -> list[str]:
    found = passes(busy_frame(3), lane_map=TOWN)
    return [hashlib.blake2b(array).hexdigest() for array in found.values()]


def test_another_process_measures_the_same() -> None:
    here = os.path.dirname(__file__)
    code = f"import sys; sys.path[:0] = {[here, *sys.path]!r}; import test_passes as t; print(t.digests())"
    fresh = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True, text=True, check=True, env={**os.environ, "PYTHONHASHSEED": "7"},
    )  # fmt: skip
    assert fresh.stdout.strip() == str(digests())
