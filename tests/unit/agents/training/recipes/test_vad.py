"""The compact VAD learns: agents, lines, paths and plans, each from its own labels."""

from __future__ import annotations

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from bev_samples import bev_samples  # noqa: E402

from drive_robust_agents._nets.matching import match  # noqa: E402
from drive_robust_agents._nets.vad import VadNet, VadSpec, choose  # noqa: E402
from drive_robust_agents.training.recipes.bev_inputs import bev_inputs, driven_in, remembered  # noqa: E402
from drive_robust_agents.training.recipes.dense import CHANNELS, dense_targets  # noqa: E402
from drive_robust_agents.training.recipes.vad import VadRecipe, plan_loss  # noqa: E402
from drive_robust_agents.training.recipes.vad_losses import class_of, lane_loss, path_loss  # noqa: E402
from pytest_drive_robust.domain.truth import ActorKind  # noqa: E402


@pytest.fixture(autouse=True)
def one_thread() -> None:
    torch.set_num_threads(1)


@pytest.fixture(scope="module")
def net() -> VadNet:
    torch.manual_seed(0)
    return VadNet(VadSpec()).eval()


def draws() -> np.random.Generator:
    return np.random.default_rng(0)


def test_on_a_few_samples_every_loss_goes_down() -> None:
    torch.manual_seed(0)
    recipe = VadRecipe()
    net = recipe.make()
    batch = recipe.batch(bev_samples(4), draws(), training=False)
    optimizer = torch.optim.AdamW(net.parameters(), lr=1e-3)
    course = []
    for _ in range(14):
        loss, parts = recipe.loss(net, batch)
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        course.append({name: float(part) for name, part in parts.items()})
    assert sum(course[-1].values()) < 0.5 * sum(course[0].values())
    for name in ("plan", "steps", "agents", "boxes", "paths", "lanes", "points", "dense", "hints"):
        assert course[-1][name] < course[0][name], name


def test_every_parameter_learns_from_one_batch() -> None:
    recipe = VadRecipe()
    net = recipe.make()
    loss, _ = recipe.loss(net, recipe.batch(bev_samples(4), draws(), training=False))
    loss.backward()
    idle = [name for name, value in net.named_parameters() if value.grad is None]
    assert idle == []


def test_the_command_picks_its_row() -> None:
    plans = torch.arange(2.0 * 6 * 6 * 2).view(2, 6, 6, 2)
    for command in range(1, 7):
        chosen = choose(plans, torch.tensor([command, 7 - command]))
        assert torch.equal(chosen[0], plans[0, command - 1])
        assert torch.equal(chosen[1], plans[1, 6 - command])


def test_the_waypoints_of_the_network_are_those_of_the_command(net: VadNet) -> None:
    inputs = net.example(6) | {"command": torch.arange(1, 7)}
    waypoints = net(**inputs)["waypoints"]
    plans = net.heads(net.encoder(inputs["images"], inputs["can_bus"], inputs["old_bev"], inputs["motion"])[0])["plans"]
    for row in range(6):
        torch.testing.assert_close(waypoints[row], plans[0, row])


def test_only_the_row_of_the_command_learns_the_plan() -> None:
    plans = torch.randn(2, 6, 6, 2, requires_grad=True)
    samples = VadRecipe().batch(bev_samples(2), draws(), training=False)
    sum(plan_loss(choose(plans, torch.tensor([1, 4])), samples).values()).backward()  # type: ignore[union-attr]
    assert plans.grad is not None
    learns = plans.grad.abs().sum((2, 3)) > 0.0
    assert learns.tolist() == [[row == 0 for row in range(6)], [row == 3 for row in range(6)]]


def test_speed_reaches_the_plan_through_the_features_only(net: VadNet) -> None:
    inputs = net.example(1)
    can_bus = torch.tensor([[5.0, 0.0, 0.0, 0.0, 2.5, 0.0]], requires_grad=True)
    fused, _ = net.encoder(inputs["images"], can_bus, inputs["old_bev"], inputs["motion"])
    (through,) = torch.autograd.grad(net.heads(fused)["plans"].sum(), can_bus, retain_graph=True)
    beside = torch.autograd.grad(net.heads(fused.detach())["plans"].sum(), can_bus, allow_unused=True)
    assert through[0, 0] != 0.0
    assert beside == (None,)


def test_where_the_future_is_not_known_the_plan_learns_nothing() -> None:
    samples = VadRecipe().batch(bev_samples(2), draws(), training=False)
    samples["plan_ok"][:, 2:] = 0.0
    samples["boxes"][..., 8] = 0.0
    samples["lane_kind"][:] = -1
    plan = torch.zeros(2, 6, 2, requires_grad=True)
    sum(plan_loss(plan, samples).values()).backward()  # type: ignore[union-attr]
    assert plan.grad is not None
    assert plan.grad[:, 2:].abs().sum() == 0.0
    assert plan.grad[:, :2, 0].abs().min() > 0.0


def test_the_waypoints_to_learn_are_half_a_second_apart() -> None:
    arrays = bev_samples(3)
    plan = VadRecipe().batch(arrays, draws(), training=False)["plan"]
    np.testing.assert_allclose(plan[:, :, 0], arrays["speed"][:, None] * np.arange(0.5, 3.1, 0.5), rtol=1e-5)


# --- memory ---


def test_in_training_half_of_the_pairs_have_a_memory_and_in_validation_all() -> None:
    arrays = {name: np.repeat(values, 16, axis=0) for name, values in bev_samples(2).items() if "cam" not in name}
    arrays |= {name: np.zeros((32, 8, 8, 3), np.uint8) for name in bev_samples(1) if "cam" in name}
    assert torch.equal(bev_inputs(dict(arrays), draws(), False)["known"].bool(), torch.from_numpy(arrays["old_ok"]))
    known = bev_inputs(dict(arrays), draws(), True)["known"]
    assert 2 <= known.sum() <= 14
    assert known[16:].sum() == 0.0


def test_without_a_memory_nothing_has_moved() -> None:
    arrays = bev_samples(4)
    inputs = bev_inputs(arrays, draws(), False)
    assert inputs["known"].tolist() == [1.0, 0.0, 1.0, 0.0]
    for name, there in (("motion", inputs["motion"][:, 0]), ("can bus", inputs["can_bus"][:, 4])):
        np.testing.assert_allclose(there, 0.5 * arrays["speed"] * [1.0, 0.0, 1.0, 0.0], rtol=1e-5, err_msg=name)


def test_the_can_bus_does_not_tell_by_how_much_a_frame_was_shifted() -> None:
    arrays = bev_samples(2)
    plain = bev_inputs(dict(arrays), draws(), False)
    arrays["pose"] = arrays["pose"] + np.array([0.0, 1.4, 0.2], dtype=np.float32)
    shifted = bev_inputs(arrays, draws(), False)
    assert torch.equal(plain["can_bus"], shifted["can_bus"])
    assert shifted["motion"][0, 1] == pytest.approx(1.4)


def test_half_a_second_of_driving_follows_from_speed_and_yaw_rate() -> None:
    radius, speed = 20.0, 8.0
    angle = 0.5 * speed / radius
    moved = driven_in(np.array([speed]), np.array([[0.0, 3.2, speed / radius]]))[0]
    assert moved == pytest.approx([radius * np.sin(angle), radius * (1.0 - np.cos(angle)), angle], rel=0.01)


def test_the_frame_of_before_decides_about_rows_that_know_it_and_moves_no_statistics(net: VadNet) -> None:
    recipe = VadRecipe()
    batch = recipe.batch(bev_samples(2), draws(), training=False)
    assert batch["known"].tolist() == [1.0, 0.0]
    told = []
    for row in (None, 0, 1):
        images = batch["old_images"].clone()
        if row is not None:
            images[row] = 255 - images[row]
        with torch.no_grad():
            told.append(float(recipe.loss(net.eval(), {**batch, "old_images": images})[0]))
    assert told[0] != told[1]
    assert told[0] == told[2]
    before = {name: value.clone() for name, value in net.named_buffers() if "running" in name}
    remembered(net.train(), lambda *frame: {"bev": net.encoder.look(*frame)}, {"bev": (64, 40, 16)}, batch)
    assert net.encoder.training
    assert all(torch.equal(value, before[name]) for name, value in net.named_buffers() if name in before)


# --- labels and sets ---


def test_a_cell_is_labelled_by_the_body_that_covers_it_and_the_lines_through_it() -> None:
    boxes = torch.zeros(1, 2, 9)
    boxes[0, 0] = torch.tensor([20.0, 5.0, 1.0, 0.0, 8.0, 2.0, 0.0, ActorKind.TRUCK, 1.0])
    boxes[0, 1] = torch.tensor([4.0, -6.0, 0.0, 1.0, 0.6, 0.6, 0.0, ActorKind.PEDESTRIAN, 1.0])
    lanes = torch.full((1, 2, 2, 2), float("nan"))
    lanes[0, 0] = torch.tensor([[0.0, 0.0], [40.0, 0.0]])
    cells = torch.tensor([[20.0, 5.0], [20.0, 8.5], [23.0, 5.0], [4.0, -6.0], [30.0, 0.9], [30.0, 4.0], [45.0, 0.0]])
    found = dense_targets(boxes, lanes, torch.tensor([[0, -1]]), cells, torch.full_like(cells, 2.0))[0]
    assert found[CHANNELS.index("vehicle")].tolist() == [1, 1, 0, 0, 0, 0, 0]
    assert found[CHANNELS.index("other")].tolist() == [0, 0, 0, 1, 0, 0, 0]
    assert found[CHANNELS.index("route")].tolist() == [0, 0, 0, 0, 1, 0, 0]
    assert found.sum() == 4


def test_the_match_is_the_cheapest_and_leaves_out_what_is_not_there() -> None:
    cost = torch.tensor([[[1.0, 0.0, 9.0], [0.9, 8.0, 9.0], [5.0, 5.0, 0.0]], [[3.0, 2.0, 1.0]] * 3])
    found = match(cost, torch.tensor([[True, True, False], [False, False, False]]))
    assert [tuple(pair) for pair in torch.stack(list(found), dim=1).tolist()] == [(0, 0, 1), (0, 1, 0)]


def test_a_cost_that_is_no_number_is_matched_last() -> None:
    found = match(torch.tensor([[[float("nan")], [3.0]]]), torch.ones(1, 1, dtype=torch.bool))
    assert found.queries.tolist() == [1]


def test_every_kind_of_actor_has_a_class() -> None:
    kinds = torch.tensor([float(kind) for kind in ActorKind])
    classes = dict(zip(ActorKind, class_of(kinds).tolist(), strict=True))
    assert {kind.name for kind, number in classes.items() if number == 0} == {"CAR", "VAN", "TRUCK", "EMERGENCY"}
    assert classes[ActorKind.BICYCLE] == 1
    assert classes[ActorKind.PEDESTRIAN] == 2
    assert {number for kind, number in classes.items() if kind > ActorKind.PEDESTRIAN} == {3}


def test_a_line_may_be_told_from_either_end() -> None:
    target = torch.full((1, 2, 3, 2), float("nan"))
    target[0, 0] = torch.tensor([[0.0, 1.0], [5.0, 1.0], [10.0, 2.0]])
    kind = torch.tensor([[2, -1]])
    logits = [torch.zeros(1, 1, 6)]
    forward = lane_loss(logits, [target[:, :1]], target, kind)
    backward = lane_loss(logits, [target[:, :1].flip(2)], target, kind)
    off = lane_loss(logits, [target[:, :1] + 1.0], target, kind)
    assert forward[1].item() == backward[1].item() == pytest.approx(0.0, abs=1e-6)
    assert off[1].item() > 0.1


def test_only_the_best_mode_learns_a_path() -> None:
    boxes = torch.zeros(1, 1, 9)
    futures = torch.zeros(1, 1, 6, 2)
    futures[0, 0, :, 0] = torch.arange(1.0, 7.0)
    futures[0, 0, 4:] = float("nan")
    paths = torch.zeros(1, 1, 3, 6, 2)
    paths[0, 0, 1, :, 0] = torch.arange(1.0, 7.0) + 0.1
    paths.requires_grad_()
    logits = torch.zeros(1, 1, 3, requires_grad=True)
    found = match(torch.zeros(1, 1, 1), torch.ones(1, 1, dtype=torch.bool))
    path_loss(paths, logits, boxes, futures, found).backward()
    assert paths.grad is not None
    assert logits.grad is not None
    assert (paths.grad.abs().sum((-1, -2)) > 0.0).tolist() == [[[False, True, False]]]
    assert paths.grad[0, 0, 1, 4:].abs().sum() == 0.0
    assert logits.grad[0, 0].argmin() == 1


def test_robust_training_spoils_the_inputs_and_never_the_labels() -> None:
    recipes = VadRecipe(), VadRecipe(robust=True)
    count = 20
    arrays = [bev_samples(count) | {"old_ok": np.ones(count, dtype=np.bool_)} for _ in recipes]
    plain, robust = (recipe.batch(mine, draws(), training=True) for recipe, mine in zip(recipes, arrays, strict=True))
    same = ("plan", "plan_ok", "boxes", "lanes", "facts", "known", "command")
    assert all(np.array_equal(plain[name], robust[name], equal_nan=True) for name in same)
    black = ((robust["images"] == 0) & (plain["images"] != 0)).all(-1).float().mean((2, 3))
    assert 0.2 < (black > 0.03).float().mean() < 0.8
    assert (robust["motion"][:, :2] - plain["motion"][:, :2]).abs().max() > 1.0
    assert torch.equal(robust["motion"][plain["known"] == 0.0], plain["motion"][plain["known"] == 0.0])
    slower = robust["can_bus"][:, 0] < plain["can_bus"][:, 0]
    assert 0 < slower.sum() < count


def test_validation_is_never_spoilt() -> None:
    plain = VadRecipe().batch(bev_samples(3), draws(), training=False)
    robust = VadRecipe(robust=True).batch(bev_samples(3), np.random.default_rng(9), training=False)
    for name, value in plain.items():
        np.testing.assert_array_equal(value, robust[name], err_msg=name)
