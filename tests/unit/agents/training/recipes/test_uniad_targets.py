"""What is drawn on the cells of the compact UniAD."""

from __future__ import annotations

import math

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from hypothesis import given  # noqa: E402
from hypothesis import strategies as st  # noqa: E402

from drive_robust_agents._nets.bev_grid import BevSpec  # noqa: E402
from drive_robust_agents._nets.bev_net import DENSE_CHANNELS  # noqa: E402
from drive_robust_agents.training.recipes.uniad_targets import (  # noqa: E402
    cells_of,
    draw,
    from_above,
    heat_of,
    in_boxes,
    occupied_by,
    on_lines,
    own_way,
)
from pytest_drive_robust.domain.truth import ActorKind  # noqa: E402

SPEC = BevSpec()
CENTRES, SIZES = SPEC.centres(), SPEC.sizes()
NAN = float("nan")


def box(x: float, y: float, yaw: float, length: float, width: float, kind: int = 0) -> torch.Tensor:
    return torch.tensor([[[x, y, math.sin(yaw), math.cos(yaw), length, width, 3.0, kind, 1.0]]])


@given(st.floats(-20.0, 70.0), st.floats(-36.0, 36.0))
def test_a_point_is_in_the_cell_that_reaches_around_it(x: float, y: float) -> None:
    number = int(cells_of(torch.tensor([x, y]), SPEC))
    if not (-16.0 < x < 64.0 and -32.0 < y < 32.0):
        assert number == SPEC.cells
        return
    row, column = divmod(min(number, SPEC.cells - 1), SPEC.columns)
    off = np.abs(np.array([x, y]) - CENTRES[row, column])
    assert off[0] <= SIZES[row, column, 0] / 2.0 + 1e-3
    assert off[1] <= 0.75 * SIZES[row, column, 1]


def test_what_is_nowhere_is_in_no_cell() -> None:
    points = torch.tensor([[NAN, 0.0], [0.0, NAN], [200.0, 0.0], [0.0, -40.0]])
    assert cells_of(points, SPEC).tolist() == [SPEC.cells] * 4
    assert draw(cells_of(points, SPEC), SPEC.cells).sum() == 0.0


@pytest.mark.parametrize("yaw", [0.0, 0.6, math.pi / 2.0, -2.0])
def test_a_body_fills_the_cells_that_it_covers(yaw: float) -> None:
    body = box(20.0, 3.0, yaw, 9.0, 2.5)
    cells = cells_of(in_boxes(body, body[..., :2]), SPEC, finer=2)
    drawn = draw(cells, 4 * SPEC.cells)[0, 0].view(80, 32).numpy() > 0.5
    away = SPEC.centres(finer=2) - [20.0, 3.0]
    along = np.abs(math.cos(yaw) * away[..., 0] + math.sin(yaw) * away[..., 1])
    aside = np.abs(math.cos(yaw) * away[..., 1] - math.sin(yaw) * away[..., 0])
    assert drawn[(along < 4.2) & (aside < 1.0)].all()
    assert not drawn[(along > 5.6) | (aside > 2.4)].any()


def test_a_body_that_is_not_there_fills_nothing() -> None:
    body = box(20.0, 3.0, 0.0, 9.0, 2.5)
    body[..., 8] = 0.0
    assert draw(cells_of(in_boxes(body, body[..., :2]), SPEC), SPEC.cells).sum() == 0.0
    assert heat_of(body, SPEC).sum() == 0.0


def test_a_line_is_drawn_without_holes() -> None:
    line = torch.stack((torch.linspace(-15.0, 63.0, 6), torch.full((6,), 1.0)), dim=-1)[None, None]
    drawn = draw(cells_of(on_lines(line), SPEC), SPEC.cells)[0, 0].view(40, 16)
    assert drawn.sum(1).tolist() == [1.0] * 40
    assert drawn[:, 8].sum() == 40.0


def test_the_picture_from_above_has_a_layer_for_each_kind() -> None:
    boxes = torch.cat((box(20.0, 0.0, 0.0, 4.0, 2.0), box(10.0, 5.0, 0.0, 1.0, 1.0, ActorKind.PEDESTRIAN)), dim=1)
    bodies, lines = torch.eye(2, 4)[None], torch.eye(4)[None, 2:]
    above = from_above(bodies, lines, boxes, torch.tensor([[4, -1]]))[0]
    filled = {DENSE_CHANNELS[layer]: above[layer].nonzero()[:, 0].tolist() for layer in range(8) if above[layer].any()}
    assert filled == {"vehicle": [0], "other": [1], "stop line": [2]}


def test_heat_is_one_in_the_middle_and_less_around_it() -> None:
    heat = heat_of(box(21.0, 1.0, 0.0, 4.0, 2.0), SPEC)[0].view(40, 16)
    assert (heat == 1.0).sum() == 1
    assert heat[18, 8] == 1.0
    assert torch.isclose(heat, torch.tensor(0.6)).sum() == 8


def test_occupancy_moves_with_the_body_and_ends_where_it_is_gone() -> None:
    body = box(10.0, 0.5, 0.0, 4.0, 1.8)
    futures = torch.tensor([[[[20.0, 0.5], [30.0, 0.5], [NAN, NAN]]]])
    maps = occupied_by(body, futures, SPEC)[0, 0].view(4, 80, 32)
    middles = [SPEC.centres(finer=2)[maps[k].numpy() > 0.5].mean(0) for k in range(3)]
    np.testing.assert_allclose(middles, [[10.0, 0.5], [20.0, 0.5], [30.0, 0.5]], atol=0.7)
    assert maps[3].sum() == 0.0


def test_a_way_is_told_along_the_body_that_goes_it() -> None:
    way = own_way(box(5.0, 5.0, math.pi / 2.0, 4.0, 2.0), torch.tensor([[[[5.0, 9.0], [4.0, 9.0]]]]))
    np.testing.assert_allclose(way[0, 0], [[4.0, 0.0], [4.0, 1.0]], atol=1e-5)
