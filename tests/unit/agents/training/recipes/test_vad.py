"""The compact VAD learns plans from its own labels."""

from __future__ import annotations

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from bev_samples import bev_samples  # noqa: E402

from drive_robust_agents._nets.vad import VadNet, VadSpec, choose  # noqa: E402
from drive_robust_agents.training.recipes.vad import VadRecipe, plan_loss  # noqa: E402


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


def test_only_the_row_of_the_command_learns_the_plan() -> None:
    plans = torch.randn(2, 6, 6, 2, requires_grad=True)
    samples = VadRecipe().batch(bev_samples(2), draws(), training=False)
    sum(plan_loss(choose(plans, torch.tensor([1, 4])), samples).values()).backward()  # type: ignore[union-attr]
    assert plans.grad is not None
    learns = plans.grad.abs().sum((2, 3)) > 0.0
    assert learns.tolist() == [[row == 0 for row in range(6)], [row == 3 for row in range(6)]]


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
