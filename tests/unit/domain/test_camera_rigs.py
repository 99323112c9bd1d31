"""Camera rigs by name."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pytest_drive_robust import rig, rig_names
from pytest_drive_robust.errors import UnknownNameError, UsageError


def test_every_name_gives_cameras_with_a_name_each_and_one_that_looks_ahead() -> None:
    assert rig_names() == ("nuscenes", "simlingo", "tcp")
    assert [len(rig(name)) for name in rig_names()] == [6, 1, 3]
    for name in rig_names():
        cameras = rig(name)
        assert len({camera.name for camera in cameras}) == len(cameras)
        assert [camera.yaw_deg for camera in cameras if camera.name == "front"] == [0.0]


def test_the_six_cameras_see_all_around_and_the_three_only_ahead() -> None:
    def seen(name: str) -> set[int]:
        """Whole degrees, clockwise from ahead, that lie in some camera's field of view."""
        return {
            degree
            for degree in range(360)
            for camera in rig(name)
            if abs(math.remainder(degree - camera.yaw_deg, 360.0)) <= camera.fov_deg / 2.0
        }

    assert seen("nuscenes") == set(range(360))
    assert seen("tcp") == set(range(91)) | set(range(270, 360))
    assert seen("simlingo") == set(range(56)) | set(range(305, 360))


def test_left_and_right_mirror_each_other() -> None:
    by_name = {camera.name: camera for camera in rig("nuscenes")}
    for side in ("front", "back"):
        left, right = by_name[f"{side}_left"], by_name[f"{side}_right"]
        assert (left.y_m, left.yaw_deg) == (-right.y_m, -right.yaw_deg)
        assert (left.x_m, left.z_m, left.fov_deg) == (right.x_m, right.z_m, right.fov_deg)
        assert left.y_m < 0.0
        assert left.yaw_deg < 0.0


def test_the_published_sizes_are_the_default() -> None:
    assert {(camera.width_px, camera.height_px) for camera in rig("nuscenes")} == {(1600, 900)}
    (wide,) = rig("simlingo")
    assert (wide.width_px, wide.height_px, wide.fov_deg) == (1024, 512, 110.0)


@given(st.sampled_from(["nuscenes", "simlingo", "tcp"]), st.integers(1, 4000), st.integers(1, 4000), st.floats(0.5, 20))
def test_size_and_rate_change_and_nothing_else_does(name: str, width: int, height: int, rate_hz: float) -> None:
    for camera, published in zip(rig(name, width_px=width, height_px=height, rate_hz=rate_hz), rig(name), strict=True):
        assert (camera.width_px, camera.height_px, camera.rate_hz) == (width, height, rate_hz)
        assert camera.fov_deg == published.fov_deg
        assert (camera.x_m, camera.y_m, camera.z_m) == (published.x_m, published.y_m, published.z_m)


def test_an_unknown_name_is_answered_with_the_nearest() -> None:
    with pytest.raises(UnknownNameError, match="Did you mean 'nuscenes'"):
        rig("nuscene")


@pytest.mark.parametrize("wrong", [{"width_px": 0}, {"height_px": -3}, {"rate_hz": 0.0}, {"rate_hz": math.nan}])
def test_impossible_cameras_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(UsageError, match=next(iter(wrong))):
        rig("tcp", **wrong)  # type: ignore[arg-type]


def test_the_embedded_world_draws_every_rig() -> None:
    from pytest_drive_robust.simulators.embedded.route_sets import named_routes
    from pytest_drive_robust.simulators.embedded.simulator import EmbeddedSimulator

    simulator = EmbeddedSimulator()
    for name in rig_names():
        simulator.reset(named_routes("one-per-scenario")[0], seed=0, cameras=rig(name, width_px=64, height_px=36))
        pictures = {key: image.pixels for key, image in simulator.observe().cameras.items()}
        assert {pixels.shape for pixels in pictures.values()} == {(36, 64, 3)}
        flat = {np.asarray(pixels).tobytes() for pixels in pictures.values()}
        assert len(flat) == len(rig(name))
    simulator.close()
