"""The compact UniAD learns: what is drawn on its cells, what each loss asks for, and in which order."""

from __future__ import annotations

import math

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from bev_samples import bev_samples  # noqa: E402
from hypothesis import given  # noqa: E402
from hypothesis import strategies as st  # noqa: E402

from drive_robust_agents._nets.bev_grid import BevSpec  # noqa: E402
from drive_robust_agents.training.recipes.bev_inputs import remembered  # noqa: E402
from drive_robust_agents.training.recipes.dense import CHANNELS  # noqa: E402
from drive_robust_agents.training.recipes.uniad import UniadRecipe  # noqa: E402
from drive_robust_agents.training.recipes.uniad_losses import (  # noqa: E402
    collision_loss,
    heat_loss,
    hint_loss,
    mask_loss,
    motion_loss,
    painted,
)
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
Batch = dict[str, torch.Tensor]


@pytest.fixture(autouse=True)
def one_thread() -> None:
    torch.set_num_threads(1)


def samples(count: int) -> Batch:
    arrays = bev_samples(count)
    facts = np.full((count, 16), 100.0, dtype=np.float32)
    facts[:, 0], facts[:, 2] = -1.0, arrays["boxes"][:, 0, 0]
    return UniadRecipe().batch(arrays | {"facts": facts}, np.random.default_rng(0), training=False)


def box(x: float, y: float, yaw: float, length: float, width: float, kind: int = 0) -> torch.Tensor:
    return torch.tensor([[[x, y, math.sin(yaw), math.cos(yaw), length, width, 3.0, kind, 1.0]]])


# --- learning ---


def test_on_a_few_samples_every_loss_goes_down() -> None:
    torch.manual_seed(0)
    recipe = UniadRecipe()
    net, batch = recipe.make(), samples(2)
    optimizer = torch.optim.AdamW(net.parameters(), lr=1e-3)
    course = []
    for _ in range(12):
        loss, parts = recipe.loss(net, batch)
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        course.append({name: float(part) for name, part in parts.items()})
    assert sum(course[-1].values()) < 0.6 * sum(course[0].values())
    standing = {"collision", "paths"}  # the only other car stands still: that is where these begin
    for name in course[0].keys() - standing:
        assert course[-1][name] < course[0][name], name


def test_every_parameter_learns_from_one_batch() -> None:
    recipe = UniadRecipe()
    net = recipe.make()
    recipe.loss(net, samples(2))[0].backward()
    assert [name for name, value in net.named_parameters() if value.grad is None] == []


def test_while_the_later_heads_rest_only_what_is_seen_is_learnt() -> None:
    recipe = UniadRecipe()
    net, batch = recipe.make(), samples(2)
    perception, everything = recipe.stages
    assert everything.frozen == ()
    for name, value in net.named_parameters():
        value.requires_grad_(not name.startswith(perception.frozen))
    loss, parts = recipe.loss(net, batch)
    loss.backward()
    assert parts.keys() & {"dense", "heat", "classes", "boxes", "lanes", "masks"}
    assert not parts.keys() & {"plan", "ego", "paths", "occupancy", "collision"}
    idle = {name.split(".")[0] for name, value in net.named_parameters() if value.grad is None}
    assert idle == set(perception.frozen)
    assert "plan" in recipe.loss(net.eval(), batch)[1]


def test_the_memory_is_made_as_in_driving_and_leaves_the_network_as_it_was() -> None:
    net, batch = UniadRecipe().make(), samples(2)
    net.planner.eval()
    before = {name: value.clone() for name, value in net.state_dict().items()}
    shapes = {"bev": (64, 40, 16), "queries": (24, 64), "spots": (24, 2)}
    old = remembered(net, net.recall, shapes, batch)
    assert net.training
    assert net.encoder.training
    assert not net.planner.training
    assert all(torch.equal(value, before[name]) for name, value in net.state_dict().items())
    for name, value in old.items():
        assert not value.requires_grad
        assert value[0].abs().sum() > 0.0, name
        assert value[1].abs().sum() == 0.0, name
    driven = net.eval().recall(batch["old_images"][:1], batch["old_can_bus"][:1])
    torch.testing.assert_close(old["bev"][:1], driven["bev"])
    torch.testing.assert_close(old["queries"][:1], driven["queries"])


# --- targets ---


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
    filled = {CHANNELS[layer]: above[layer].nonzero()[:, 0].tolist() for layer in range(8) if above[layer].any()}
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


# --- losses ---


def straight(right_m: float = 0.0) -> torch.Tensor:
    return torch.stack((torch.arange(1.0, 7.0) * 3.0, torch.full((6,), right_m)), dim=-1)[None]


def expert(right_m: float = 0.0) -> torch.Tensor:
    return torch.cat((straight(right_m), torch.zeros(1, 6, 1)), dim=-1)


def test_a_plan_into_a_body_is_pushed_out_of_it() -> None:
    body, futures = box(9.0, 0.8, 0.0, 4.0, 2.0), torch.tensor([9.0, 0.8]).expand(1, 1, 6, 2)
    plan = straight().requires_grad_()
    collision_loss(plan, expert(-4.0), body, futures).backward()
    assert plan.grad is not None
    assert plan.grad[0, 2, 1] > 0.0
    assert plan.grad[0, 5].abs().sum() == 0.0


def test_a_plan_beside_a_body_and_one_that_the_expert_drove_cost_nothing() -> None:
    body, futures = box(9.0, 0.8, 0.0, 4.0, 2.0), torch.tensor([9.0, 0.8]).expand(1, 1, 6, 2)
    assert collision_loss(straight(-4.0), expert(-4.0), body, futures) == 0.0
    assert collision_loss(straight(), expert(), body, futures) == 0.0
    assert collision_loss(straight(), expert(-4.0), body, torch.full_like(futures, NAN)) == 0.0
    closer = [collision_loss(straight(y), expert(-4.0), body, futures) for y in (-2.0, -1.5, -0.5)]
    assert 0.0 < closer[0] < closer[1] < closer[2]


def test_only_the_nearest_mode_learns_a_way_and_what_is_not_known_is_left_out() -> None:
    way = straight()
    way[:, 4:] = NAN
    paths = torch.stack((straight(5.0), straight(0.3), straight(-4.0)), dim=1).requires_grad_()
    spread, logits = torch.zeros(1, 3, 6, 3), torch.zeros(1, 3, requires_grad=True)
    motion_loss(paths, spread, logits, way).backward()
    assert paths.grad is not None
    assert logits.grad is not None
    assert (paths.grad.abs().sum((-1, -2)) > 0.0).tolist() == [[False, True, False]]
    assert paths.grad[0, 1, 4:].abs().sum() == 0.0
    assert logits.grad[0].argmin() == 1


def test_a_wider_spread_costs_less_where_the_way_was_missed_and_more_where_it_was_met() -> None:
    tight, wide = torch.zeros(1, 1, 6, 3), torch.zeros(1, 1, 6, 3)
    wide[..., :2] = 1.0

    def loss(right_m: float, spread: torch.Tensor) -> float:
        return float(motion_loss(straight(right_m)[:, None], spread, torch.zeros(1, 1), straight()))

    assert loss(4.0, wide) < loss(4.0, tight)
    assert loss(0.0, wide) > loss(0.0, tight)


def test_lanes_that_are_painted_right_cost_least_whatever_query_paints_them() -> None:
    truth = torch.zeros(1, 2, 20)
    truth[0, 0, :5], truth[0, 1, 12:15] = 1.0, 1.0
    kind = torch.tensor([[2, 0]])
    logits = torch.full((1, 3, 6), -4.0)
    logits[0, 2, 2], logits[0, 0, 0] = 4.0, 4.0
    masks = torch.full((1, 3, 20), -6.0)
    masks[0, 2, :5], masks[0, 0, 12:15] = 6.0, 6.0
    right = mask_loss(logits, masks, truth, kind)
    wrong = mask_loss(logits, masks.flip(2), truth, kind)
    assert right[1] < 0.2 < wrong[1]
    assert right[0] < mask_loss(logits.flip(2), masks, truth, kind)[0]


def test_without_lanes_and_agents_the_losses_are_numbers() -> None:
    found = mask_loss(torch.zeros(1, 2, 6), torch.zeros(1, 2, 9), torch.zeros(1, 3, 9), torch.full((1, 3), -1))
    none = motion_loss(torch.zeros(1, 3, 6, 2), torch.zeros(1, 3, 6, 3), torch.zeros(1, 3), torch.full((1, 6, 2), NAN))
    nothing = torch.zeros(1, 9)
    values = [*found, none, painted(nothing[:0], nothing[:0]), heat_loss(nothing, nothing)]
    assert all(math.isfinite(float(value)) for value in values)
    assert values[1] == values[2] == 0.0


def test_a_hint_asks_for_the_light_only_where_it_is_near() -> None:
    facts = torch.full((2, 16), 100.0)
    facts[:, 0], facts[0, 1] = 2.0, 20.0
    hints = torch.zeros(2, 8, requires_grad=True)
    hint_loss(hints, facts).backward()
    assert hints.grad is not None
    assert hints.grad[:, :5].argmin(1).tolist() == [3, 0]
