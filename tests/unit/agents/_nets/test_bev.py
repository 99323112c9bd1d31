"""The bird's-eye map of UniAD and VAD: what is seen lands in the right cell, what is remembered moves the right way."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

torch = pytest.importorskip("torch")

from drive_robust_agents._nets.bev import (  # noqa: E402
    BevEncoder,
    BevLift,
    TemporalFusion,
    columns_of,
    rows_of,
    warp,
)
from drive_robust_agents._nets.bev_grid import BevSpec, project  # noqa: E402

SPEC = BevSpec()
CENTRES = torch.from_numpy(SPEC.centres())
COLUMNS = SPEC.image_width_px // SPEC.token_px


def cell_of(x: float, y: float) -> tuple[int, int]:
    away = np.hypot(*(SPEC.centres() - np.float32([x, y])).transpose(2, 0, 1))
    row, column = np.unravel_index(int(away.argmin()), away.shape)
    return int(row), int(column)


def test_what_all_tokens_hold_arrives_everywhere() -> None:
    lift, tokens = BevLift(SPEC), COLUMNS * (SPEC.image_height_px // SPEC.token_px)
    key_value = torch.cat((torch.zeros(1, 6, tokens, 64), torch.full((1, 6, tokens, 64), 3.0)), dim=-1)
    seen = lift.look(torch.zeros(1, SPEC.cells, 64), key_value)
    torch.testing.assert_close(seen, torch.full_like(seen, 3.0))


@pytest.mark.parametrize(
    ("camera", "x", "y"),
    [
        ("front", 9.0, 1.0),
        ("front", 31.0, -5.0),
        ("front_right", 7.0, 12.0),
        ("front_left", 7.0, -12.0),
        ("back", -13.0, 1.0),
    ],
)
def test_a_point_on_the_ground_lights_up_the_cell_where_it_is(camera: str, x: float, y: float) -> None:
    row, column = cell_of(x, y)
    centre = SPEC.centres()[row, column].astype(np.float64)
    number = SPEC.cameras.index(camera)
    u, v, _ = project(SPEC.rig()[number], centre[:1], centre[1:], SPEC.heights_m[0])
    key_value = torch.zeros(1, 6, 240, 128)
    key_value[0, number, int(v[0] // 8) * COLUMNS + int(u[0] // 8), 64:] = 1.0
    lit = BevLift(SPEC).look(torch.zeros(1, SPEC.cells, 64), key_value)[0, :, :16].mean(-1).view(40, 16).detach()
    assert lit[row, column] > 0.5 * lit.max() > 0.0
    bearing = torch.atan2(CENTRES[..., 1], CENTRES[..., 0])
    turned = (bearing - math.atan2(centre[1], centre[0]) + math.pi).remainder(math.tau) - math.pi
    beside = (turned.abs() > 0.7) & (CENTRES.norm(dim=-1) > 6.0)
    assert lit[beside].abs().max() == 0.0


def test_a_camera_that_sees_nothing_of_a_cell_does_not_change_it() -> None:
    torch.manual_seed(0)
    lift, key_value = BevLift(SPEC), torch.randn(1, 6, 240, 128)
    query = torch.randn(1, SPEC.cells, 64)
    before = lift.look(query, key_value)
    key_value[:, SPEC.cameras.index("back")] = 7.0
    changed = (lift.look(query, key_value) != before).any(-1)[0].view(40, 16)
    assert changed[:6].any()
    assert not changed[CENTRES[:, 0, 0] > -2.0].any()


# --- the memory ---


def bump(x: float, y: float) -> torch.Tensor:
    field = torch.zeros(1, 1, SPEC.rows, SPEC.columns)
    field[(0, 0, *cell_of(x, y))] = 1.0
    return field


@pytest.mark.parametrize(
    ("motion", "was", "now"),
    [
        ((4.0, 0.0, 0.0), (21.0, 1.0), (17.0, 1.0)),
        ((-6.0, 0.0, 0.0), (21.0, 1.0), (27.0, 1.0)),
        ((0.0, 0.0, math.pi / 2.0), (9.0, 1.1), (1.1, -8.8)),
        ((0.0, 0.0, -math.pi / 2.0), (9.0, 1.1), (-1.0, 8.8)),
        ((0.0, 2.3, 0.0), (9.0, 1.1), (9.0, -1.1)),
    ],
)
def test_a_memory_lies_where_the_thing_is_now(
    motion: tuple[float, float, float], was: tuple[float, float], now: tuple[float, float]
) -> None:
    moved = warp(bump(*was), torch.tensor([motion]), CENTRES, SPEC)[0, 0]
    assert np.unravel_index(int(moved.argmax()), moved.shape) == cell_of(*now)


@settings(deadline=None, max_examples=30)
@given(st.floats(-5.0, 15.0), st.floats(-3.0, 3.0), st.floats(-0.6, 0.6))
def test_warping_reads_the_map_of_before_at_the_right_place(forward: float, right: float, yaw: float) -> None:
    memory = torch.stack((rows_of(CENTRES[..., 0], SPEC), columns_of(CENTRES[..., 1], SPEC)))[None]
    moved = warp(memory, torch.tensor([[forward, right, yaw]]), CENTRES, SPEC)[0]
    x = forward + math.cos(yaw) * CENTRES[..., 0] - math.sin(yaw) * CENTRES[..., 1]
    y = right + math.sin(yaw) * CENTRES[..., 0] + math.cos(yaw) * CENTRES[..., 1]
    wanted = torch.stack((rows_of(x, SPEC), columns_of(y, SPEC)))
    inside = (wanted[0].abs() < 1.0 - 1.0 / 40.0) & (wanted[1].abs() < 1.0 - 1.0 / 16.0)
    torch.testing.assert_close(moved[:, inside], wanted[:, inside], atol=1e-4, rtol=0.0)
    outside = (wanted[0].abs() > 1.0 + 1.0 / 40.0) | (wanted[1].abs() > 1.0 + 1.0 / 16.0)
    assert (moved[:, outside] == 0.0).all()


def test_no_memory_adds_nothing_wherever_one_has_moved() -> None:
    torch.manual_seed(0)
    fusion, now = TemporalFusion(SPEC).eval(), torch.randn(2, 64, 40, 16)
    nothing = torch.zeros_like(now)
    still = fusion(now, nothing, torch.zeros(2, 3))
    assert torch.equal(still, fusion(now, nothing, torch.tensor([[5.0, 1.0, 0.3]] * 2)))
    assert torch.equal(still, fusion.mix(now))


def test_tables_of_the_rig_are_no_weights() -> None:
    names = BevEncoder(SPEC).state_dict()
    assert not [
        name for name in names if name.split(".")[-1].startswith(("cells_", "bias_", "gather", "share", "centres"))
    ]
    assert sum(value.numel() for name, value in names.items() if "running" not in name) < 420_000
