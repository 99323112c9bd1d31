"""The inputs of UniAD and VAD in training: the frame before, the can bus."""

from __future__ import annotations

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from bev_samples import bev_samples  # noqa: E402

from drive_robust_agents._nets.vad import VadNet, VadSpec  # noqa: E402
from drive_robust_agents.training.recipes.bev_inputs import bev_inputs, driven_in, remembered  # noqa: E402
from drive_robust_agents.training.recipes.vad import VadRecipe  # noqa: E402


@pytest.fixture(scope="module")
def net() -> VadNet:
    torch.manual_seed(0)
    return VadNet(VadSpec()).eval()


def draws() -> np.random.Generator:
    return np.random.default_rng(0)


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
