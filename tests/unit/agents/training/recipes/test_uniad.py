"""The compact UniAD learns: every loss goes down, in the order of its stages, with the memory of driving."""

from __future__ import annotations

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from bev_samples import bev_samples  # noqa: E402

from drive_robust_agents.training.recipes.bev_inputs import remembered  # noqa: E402
from drive_robust_agents.training.recipes.uniad import UniadRecipe  # noqa: E402

Batch = dict[str, torch.Tensor]


def samples(count: int) -> Batch:
    arrays = bev_samples(count)
    facts = np.full((count, 16), 100.0, dtype=np.float32)
    facts[:, 0], facts[:, 2] = -1.0, arrays["boxes"][:, 0, 0]
    return UniadRecipe().batch(arrays | {"facts": facts}, np.random.default_rng(0), training=False)


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
