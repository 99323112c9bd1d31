"""The blocks that all compact networks are made of."""

# ruff: noqa: E402 - without torch, which is an extra, these tests are skipped before the imports that need it

from __future__ import annotations

import pytest

torch = pytest.importorskip("torch")

from drive_robust_agents._nets.blocks import (
    ConvBnRelu,
    ImageNorm,
    MiniResNet,
    Mlp,
    channels_last,
    fold_batch_norm,
)


@pytest.fixture(scope="module", autouse=True)
def _seed() -> None:
    torch.manual_seed(5)


def trained_encoder() -> MiniResNet:
    encoder = channels_last(MiniResNet((16, 24), stem=8)).train()
    for _ in range(3):
        encoder(torch.randn(4, 3, 32, 64))
    return encoder.eval()


def test_images_are_normalised_into_channels_last_memory_without_touching_the_original() -> None:
    image = torch.randint(0, 256, (2, 8, 12, 3), dtype=torch.uint8)
    kept = image.clone()
    planes = ImageNorm()(image)
    assert planes.shape == (2, 3, 8, 12)
    assert planes.is_contiguous(memory_format=torch.channels_last)
    assert torch.equal(image, kept)
    assert planes[1, 2, 3, 4].item() == pytest.approx((image[1, 3, 4, 2].item() - 114.5) / 57.6, abs=1e-6)


def test_cameras_become_rows_in_their_order() -> None:
    images = torch.randint(0, 256, (2, 3, 8, 12, 3), dtype=torch.uint8)
    planes = ImageNorm()(images)
    assert planes.shape == (6, 3, 8, 12)
    assert torch.equal(planes[4], ImageNorm()(images[1, 1][None])[0])


def test_an_encoder_divides_the_image_by_its_total_stride() -> None:
    encoder = MiniResNet((16, 24, 32), stem=8)
    assert encoder(torch.zeros(1, 3, 128, 256)).shape == (
        1,
        32,
        128 // encoder.total_stride,
        256 // encoder.total_stride,
    )


def test_folding_changes_outputs_by_rounding_only_and_leaves_no_normalisation() -> None:
    encoder, image = trained_encoder(), torch.randn(2, 3, 32, 64)
    with torch.inference_mode():
        before = encoder(image)
        after = fold_batch_norm(encoder)(image)
    assert before.abs().max() > 0.1
    assert (before - after).abs().max() < 1e-5
    assert not any(isinstance(module, torch.nn.BatchNorm2d) for module in encoder.modules())


def test_a_block_without_rectifier_may_give_negative_numbers() -> None:
    block = ConvBnRelu(3, 8, relu=False)
    assert block(torch.randn(2, 3, 8, 8)).min() < 0.0
    assert ConvBnRelu(3, 8)(torch.randn(2, 3, 8, 8)).min() >= 0.0


def test_an_mlp_ends_without_activation_unless_asked() -> None:
    mlp, ends = Mlp(4, 8, 6), Mlp(4, 8, 6, last=True)
    assert [type(layer).__name__ for layer in mlp] == ["Linear", "ReLU", "Linear"]
    assert ends(torch.randn(64, 4)).min() >= 0.0
