"""The cells of the bird's-eye grid, and where cameras see them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

torch = pytest.importorskip("torch")

from drive_robust_agents._nets.bev import (  # noqa: E402
    columns_of,
    rows_of,
)
from drive_robust_agents._nets.bev_grid import OUT_OF_SIGHT, BevSpec, camera_views, project  # noqa: E402
from pytest_drive_robust.simulators.embedded.drawing.canvas import CameraView  # noqa: E402

SPEC = BevSpec()
CENTRES = torch.from_numpy(SPEC.centres())


def test_cells_fill_the_range_and_are_narrow_in_the_middle() -> None:
    sizes = SPEC.sizes()
    assert sizes[..., 0].sum(axis=0) == pytest.approx(80.0, rel=1e-5)
    assert sizes[..., 1].sum(axis=1) == pytest.approx(64.0, rel=1e-5)
    assert sizes[0, 8, 1] < 2.5 < 6.0 < sizes[0, 0, 1]


def test_coordinates_of_centres_are_evenly_spaced() -> None:
    rows, columns = rows_of(CENTRES[..., 0], SPEC), columns_of(CENTRES[..., 1], SPEC)
    for found, count in ((rows[:, 0], SPEC.rows), (columns[0], SPEC.columns)):
        torch.testing.assert_close(found, (2.0 * torch.arange(count) + 1.0) / count - 1.0, atol=1e-5, rtol=0.0)


def test_finer_cells_lie_in_their_cells() -> None:
    coarse, fine = SPEC.centres(), SPEC.centres(finer=2)
    assert fine.shape == (80, 32, 2)
    np.testing.assert_allclose(fine[::2, :, 0] + fine[1::2, :, 0], 2.0 * coarse[:, :1, 0].repeat(32, 1), atol=1e-4)
    assert (fine[0, ::2, 1] < coarse[0, :, 1]).all()
    assert (fine[0, 1::2, 1] > coarse[0, :, 1]).all()


@given(
    st.integers(0, 5), st.floats(-60.0, 60.0), st.floats(-60.0, 60.0), st.floats(0.0, 6.0),
    st.tuples(st.floats(-99.0, 99.0), st.floats(-99.0, 99.0), st.floats(-4.0, 4.0)),
)  # fmt: skip
def test_points_are_projected_as_the_renderer_does(
    number: int, x: float, y: float, z: float, pose: tuple[float, float, float]
) -> None:
    camera, (ego_x, ego_y, yaw) = SPEC.rig()[number], pose
    u, v, before = project(camera, np.array([x]), np.array([y]), z)
    view = CameraView.of(camera, ego_x, ego_y, yaw)
    dx = ego_x + math.cos(yaw) * x - math.sin(yaw) * y - view.x_m
    dy = ego_y + math.sin(yaw) * x + math.cos(yaw) * y - view.y_m
    forward = dx * view.cos_yaw + dy * view.sin_yaw
    right = dy * view.cos_yaw - dx * view.sin_yaw
    if not before[0]:
        assert forward <= 0.5 + 1e-6
        return
    assert u[0] == pytest.approx(camera.width_px / 2.0 + view.focal_px * right / forward, abs=1e-5)
    assert v[0] == pytest.approx(camera.height_px / 2.0 - view.focal_px * (z - view.z_m) / forward, abs=1e-5)


def test_every_cell_is_seen_by_some_camera() -> None:
    seen = {int(cell) for view in camera_views(SPEC) for cell in view.cells}
    assert seen == set(range(SPEC.cells))


def test_a_head_looks_at_no_more_than_nine_tokens_and_never_at_none() -> None:
    for view in camera_views(SPEC):
        looks = (view.bias > OUT_OF_SIGHT).sum(axis=2)
        assert looks.min() >= 1
        assert looks.max() <= 9
