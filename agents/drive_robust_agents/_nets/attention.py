"""Building blocks of query sets: attention, attention layers, and codes of places.

Shapes are written (N, ...) for a batch of N: Q queries look at K keys.
"""

from __future__ import annotations

import math

import torch
from torch import Tensor, nn
from torch.nn import functional

from drive_robust_agents._nets.blocks import Mlp

__all__ = ["Attention", "CrossLayer", "DecoderLayer", "PointEncoding", "attend"]


def attend(query: Tensor, key: Tensor, value: Tensor, *, mask: Tensor | None = None, causal: bool = False) -> Tensor:
    """Compute scaled dot-product attention: (..., Q, d), (..., K, d), (..., K, d) -> (..., Q, d).

    Under mixed precision on a CPU the product is computed in float32, because torch's bfloat16 attention takes three
    times as long there, forward and back.
    """
    if query.device.type == "cpu" and torch.is_autocast_enabled("cpu"):
        mask = mask if mask is None or mask.dtype == torch.bool else mask.float()
        with torch.autocast("cpu", enabled=False):
            return attend(query.float(), key.float(), value.float(), mask=mask, causal=causal)
    return functional.scaled_dot_product_attention(query, key, value, attn_mask=mask, is_causal=causal)


class Attention(nn.Module):
    """Multi-head attention: queries (N, Q, d) over keys and values (N, K, d) -> (N, Q, d)."""

    def __init__(self, width: int, heads: int) -> None:
        super().__init__()
        if width % heads:
            raise ValueError(f"a width of {width} cannot be divided among {heads} heads")
        self.heads = heads
        self.query = nn.Linear(width, width)
        self.key = nn.Linear(width, width)
        self.value = nn.Linear(width, width)
        self.out = nn.Linear(width, width)

    def forward(
        self,
        query: Tensor,
        key: Tensor | None = None,
        value: Tensor | None = None,
        *,
        mask: Tensor | None = None,
    ) -> Tensor:
        """Attend to the keys; without `key` to the queries themselves, without `value` with the keys as values.

        `mask` is True (or 0.0) where a query may look, broadcast to (N, heads, Q, K). Every query must be allowed to
        look at some key.
        """
        key = query if key is None else key
        value = key if value is None else value
        q, k, v = self._split(self.query(query)), self._split(self.key(key)), self._split(self.value(value))
        mixed = attend(q, k, v, mask=mask)
        y: Tensor = self.out(mixed.transpose(1, 2).flatten(2))
        return y

    def _split(self, x: Tensor) -> Tensor:
        """Split the heads: (N, L, d) -> (N, heads, L, d / heads)."""
        return x.reshape(x.shape[0], x.shape[1], self.heads, -1).transpose(1, 2)


class CrossLayer(nn.Module):
    """Cross-attention and feed-forward, normalised after each: (N, Q, d) and (N, K, d) -> (N, Q, d)."""

    def __init__(self, width: int, heads: int) -> None:
        super().__init__()
        self.attention = Attention(width, heads)
        self.feed_forward = Mlp(width, 2 * width, width)
        self.norms = nn.ModuleList(nn.LayerNorm(width) for _ in range(2))

    def forward(self, query: Tensor, keys: Tensor, values: Tensor | None = None) -> Tensor:
        """Attend to all keys, which are also the values unless `values` are given."""
        query = self.norms[0](query + self.attention(query, keys, values))
        y: Tensor = self.norms[1](query + self.feed_forward(query))
        return y


class DecoderLayer(nn.Module):
    """Self-attention among queries, cross-attention to a memory, feed-forward (2 d); normalised after each (post-norm).

    (N, Q, d) and (N, K, d) -> (N, Q, d). Position codes are added to queries and keys, never to values.
    """

    def __init__(self, width: int, heads: int) -> None:
        super().__init__()
        self.self_attention = Attention(width, heads)
        self.cross_attention = Attention(width, heads)
        self.feed_forward = Mlp(width, 2 * width, width)
        self.norms = nn.ModuleList(nn.LayerNorm(width) for _ in range(3))

    def forward(
        self,
        query: Tensor,
        memory: Tensor,
        *,
        query_position: Tensor | None = None,
        memory_position: Tensor | None = None,
        memory_mask: Tensor | None = None,
    ) -> Tensor:
        """Refine the queries. `memory_mask` as in `Attention.forward`."""
        placed = query if query_position is None else query + query_position
        query = self.norms[0](query + self.self_attention(placed, placed, query))
        placed = query if query_position is None else query + query_position
        keys = memory if memory_position is None else memory + memory_position
        query = self.norms[1](query + self.cross_attention(placed, keys, memory, mask=memory_mask))
        y: Tensor = self.norms[2](query + self.feed_forward(query))
        return y


class PointEncoding(nn.Module):
    """A code for points in metres: waves of 128, 64, 32 and 16 m through an MLP, (..., 2) -> (..., width)."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.frequencies = tuple(math.tau / length for length in (128.0, 64.0, 32.0, 16.0))
        self.mix = Mlp(16, width, width)

    def forward(self, points: Tensor) -> Tensor:
        """Encode points (..., 2) in metres to (..., width)."""
        waves = torch.cat([points * frequency for frequency in self.frequencies], dim=-1)
        y: Tensor = self.mix(torch.cat([waves.sin(), waves.cos()], dim=-1))
        return y
