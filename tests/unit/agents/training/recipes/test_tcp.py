"""What `tcp` learns: targets from labels, the parts of the loss, and what `--robust` does to inputs and labels."""

# ruff: noqa: E402 - without torch, which is an extra, these tests are skipped before the imports that need it

from __future__ import annotations

from typing import Any

import pytest

torch = pytest.importorskip("torch")
import numpy as np
from frames_on_disk import made_row
from numpy.typing import NDArray
from tiny_tcp import CAMERAS, tiny_net

from drive_robust_agents.tcp import joined
from drive_robust_agents.training.recipes.tcp import TcpRecipe, beta_nll

PICTURES = ("cam_front_left", "cam_front", "cam_front_right")


def rng(seed: int = 0) -> np.random.Generator:
    return np.random.Generator(np.random.Philox(seed))


@pytest.fixture
def arrays() -> dict[str, NDArray[Any]]:
    rows = [made_row(rng(7 + k), episode=0, tick=5 * k, cameras=CAMERAS) for k in range(60)]
    return {name: np.stack([row[name] for row in rows]) for name in rows[0]}


def test_waypoints_are_half_seconds_of_the_future_and_the_command_is_that_of_the_near_planner(
    arrays: dict[str, NDArray[Any]],
) -> None:
    arrays["command"][:, 1] = 9
    batch = TcpRecipe().batch(arrays, rng(), training=False)
    assert np.allclose(batch["true_waypoints"][:, 2].numpy(), arrays["future"][:, 5, :2])
    assert np.array_equal(batch["command"].numpy(), arrays["command"][:, 0])
    assert np.array_equal(batch["image"].numpy(), joined([arrays[name] for name in PICTURES]))
    assert np.array_equal(batch["target"].numpy(), arrays["target"][:, 0, 0])
    assert batch["true_ok"].shape == (60, 4)


def test_actions_are_steering_and_signed_pedals_within_the_distribution(arrays: dict[str, NDArray[Any]]) -> None:
    arrays["controls"][0, 0] = (0.0, -1.0, 1.0)  # full left, full brake
    arrays["controls"][1, 0] = (1.0, 1.0, 0.0)  # full right, full throttle
    arrays["controls"][2, 0] = (0.0, 0.0, 0.0)
    actions = TcpRecipe().batch(arrays, rng(), training=False)["true_actions"]
    assert actions[0, 0].tolist() == pytest.approx([0.02, 0.02])
    assert actions[1, 0].tolist() == pytest.approx([0.98, 0.98])
    assert actions[2, 0].tolist() == pytest.approx([0.5, 0.5])
    assert actions.shape == (60, 5, 2)


def test_a_free_way_is_worth_more_than_a_near_or_slow_leader(arrays: dict[str, NDArray[Any]]) -> None:
    arrays["speed"][:3] = 10.0
    arrays["gap"][:3] = [(100.0, 10.0), (15.0, 10.0), (15.0, 0.0)]
    value = TcpRecipe().batch(arrays, rng(), training=False)["true_value"]
    assert 1.0 > value[0] > value[1] > value[2] > 0.0


def test_the_likelihood_is_that_of_the_beta_distribution() -> None:
    alpha, beta = 1.0 + 5.0 * torch.rand(9), 1.0 + 5.0 * torch.rand(9)
    value = torch.linspace(0.05, 0.95, 9)
    assert torch.allclose(
        beta_nll(alpha, beta, value), -torch.distributions.Beta(alpha, beta).log_prob(value), atol=1e-5
    )


def test_waypoints_that_nobody_drove_cost_nothing(arrays: dict[str, NDArray[Any]]) -> None:
    net, recipe = tiny_net().eval(), TcpRecipe()
    arrays["future_ok"][:, 6:] = False
    batch = recipe.batch(arrays, rng(), training=False)
    loss, parts = recipe.loss(net, batch)
    batch["true_waypoints"][:, 3] += 1000.0  # at 2 s
    assert torch.equal(recipe.loss(net, batch)[0], loss)
    batch["true_waypoints"][:, 0] += 1000.0
    assert recipe.loss(net, batch)[0] > loss + 100.0
    expected = parts["waypoints"] + 0.1 * parts["actions"] + 0.05 * parts["speed"] + 0.001 * parts["value"]
    assert loss.item() == pytest.approx(float(expected), rel=1e-5)


def test_plain_training_changes_images_only(arrays: dict[str, NDArray[Any]]) -> None:
    kept = [arrays[name].copy() for name in PICTURES]
    plain, trained = (TcpRecipe().batch(arrays, rng(), training=training) for training in (False, True))
    assert all(np.array_equal(arrays[name], before) for name, before in zip(PICTURES, kept, strict=True))
    assert [name for name in plain if not torch.equal(plain[name], trained[name])] == ["image"]


def test_robust_training_changes_what_is_sensed_for_some_rows_but_not_what_is_true(
    arrays: dict[str, NDArray[Any]],
) -> None:
    plain = TcpRecipe().batch(arrays, rng(), training=False)
    robust = TcpRecipe(robust=True).batch(arrays, rng(1), training=True)
    changed = {name for name in plain if not torch.equal(plain[name], robust[name])}
    assert changed == {"image", "speed", "target", "true_waypoints"}
    for name in ("speed", "target", "true_waypoints"):
        same = (plain[name] == robust[name]).flatten(1).all(1) if plain[name].ndim > 1 else plain[name] == robust[name]
        assert 0.4 < same.float().mean() < 0.9, name
    reads_less = robust["speed"][robust["speed"] != plain["speed"]] / plain["speed"][robust["speed"] != plain["speed"]]
    assert 0.3 < reads_less.mean() < 0.9
    assert torch.equal(TcpRecipe(robust=True).batch(arrays, rng(1), training=True)["image"], robust["image"])


def test_robust_training_hides_parts_of_each_camera_on_its_own(
    arrays: dict[str, NDArray[Any]], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("drive_robust_agents.training.recipes.tcp.tcp_hard", lambda *_, **__: None)
    for name in PICTURES:
        arrays[name][:] = 200
    image = TcpRecipe(robust=True).batch(arrays, rng(3), training=True)["image"].numpy()
    hit = np.stack([(third == 0).any((1, 2, 3)) for third in np.split(image, 3, axis=2)])
    assert np.all((hit.mean(axis=1) > 0.3) & (hit.mean(axis=1) < 0.7))
    assert 0.2 < (hit[0] != hit[1]).mean() < 0.8


def test_late_waypoints_of_a_straight_drive_begin_at_the_later_place(arrays: dict[str, NDArray[Any]]) -> None:
    metres = 2.0 * np.arange(1, 13)
    arrays["future"][:] = np.stack([metres, np.zeros(12), np.zeros(12), np.full(12, 8.0)], axis=1)
    waypoints = TcpRecipe(robust=True).batch(arrays, rng(2), training=True)["true_waypoints"]
    # equal steps of the same straight drive, seen from any later place, are the same steps again
    assert torch.allclose(waypoints, torch.tensor([[4.0, 0.0], [8.0, 0.0], [12.0, 0.0], [16.0, 0.0]]), atol=1e-5)


def test_late_waypoints_of_a_car_that_stops_are_shorter(arrays: dict[str, NDArray[Any]]) -> None:
    way = np.minimum(2.0 * np.arange(1, 13), 6.0)
    arrays["future"][:] = np.stack([way, np.zeros(12), np.zeros(12), np.zeros(12)], axis=1)
    ends = TcpRecipe(robust=True).batch(arrays, rng(2), training=True)["true_waypoints"][:, 3, 0]
    assert set(ends.tolist()) == {6.0, 4.0, 2.0}


def test_late_waypoints_turn_with_the_car(arrays: dict[str, NDArray[Any]]) -> None:
    radius, angle = 10.0, 0.1 * np.arange(1, 13)
    circle = np.stack([radius * np.sin(angle), radius * (1 - np.cos(angle)), angle, np.full(12, 4.0)], axis=1)
    arrays["future"][:] = circle
    waypoints = TcpRecipe(robust=True).batch(arrays, rng(2), training=True)["true_waypoints"]
    expected = torch.tensor(circle[[1, 3, 5, 7], :2], dtype=torch.float32)
    assert torch.allclose(
        waypoints, expected.expand_as(waypoints), atol=1e-4
    )  # a circle looks the same from everywhere
