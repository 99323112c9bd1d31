"""Attention and the layers around it."""

# ruff: noqa: E402 - without torch, which is an extra, these tests are skipped before the imports that need it

from __future__ import annotations

import pytest

torch = pytest.importorskip("torch")

from drive_robust_agents._nets.attention import Attention, DecoderLayer, attend


@pytest.fixture(scope="module", autouse=True)
def _seed() -> None:
    torch.manual_seed(5)


def test_attention_sees_only_what_its_mask_allows() -> None:
    attention = Attention(8, 2).eval()
    query, memory = torch.randn(1, 3, 8), torch.randn(1, 5, 8)
    mask = torch.tensor([[True, True, True, False, False]])
    changed = memory.clone()
    changed[:, 3:] = 100.0
    assert torch.allclose(attention(query, memory, mask=mask), attention(query, changed, mask=mask))
    assert not torch.allclose(attention(query, memory), attention(query, changed))


def test_heads_must_divide_the_width() -> None:
    with pytest.raises(ValueError, match=r"width of 10 .* 4 heads"):
        Attention(10, 4)


def test_a_decoder_layer_keeps_rows_apart_and_queries_in_shape() -> None:
    layer = DecoderLayer(16, 4).eval()
    query, memory = torch.randn(3, 5, 16), torch.randn(3, 7, 16)
    whole = layer(query, memory, query_position=torch.randn(5, 16), memory_position=torch.zeros(7, 16))
    assert whole.shape == query.shape
    alone = layer(query[1:2], memory[1:2])
    assert torch.allclose(layer(query, memory)[1:2], alone, atol=1e-5)


@pytest.mark.parametrize("mask", [None, "bool", "float"])
def test_attention_is_computed_in_float32_under_mixed_precision_on_a_cpu(mask: str | None) -> None:
    query, key, value = (torch.randn(2, 3, count, 8) for count in (4, 6, 6))
    allowed = torch.rand(4, 6) < 0.7
    allowed[:, 0] = True
    masks = {None: None, "bool": allowed, "float": torch.where(allowed, 0.0, -torch.inf)}
    exact = attend(query, key, value, mask=masks[mask])
    with torch.autocast("cpu", torch.bfloat16):
        mixed = attend(query, key, value, mask=masks[mask])
        halves = attend(*(x.bfloat16() for x in (query, key, value)), mask=masks[mask])
    assert torch.equal(mixed, exact)
    assert halves.dtype == torch.float32
    assert torch.allclose(halves, exact, atol=0.03)
