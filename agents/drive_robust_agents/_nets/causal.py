"""A causal transformer that caches keys and values, so that no place is computed twice.

`simlingo` reads one image, then a prompt, then (word by word) its own answer, then its queries. Each of these parts is
one call of `Decoder.forward` with the cache of all earlier parts.
"""

from __future__ import annotations

from collections.abc import Iterator

import torch
from torch import Tensor, nn

from drive_robust_agents._nets.attention import attend
from drive_robust_agents._nets.blocks import Mlp

__all__ = ["Cache", "CausalLayer", "Decoder", "select"]

Cache = list[tuple[Tensor, Tensor]]
"""Keys and values of all places so far by layer, both (N, heads, places, width / heads)."""


class CausalLayer(nn.Module):
    """Normalise, attend, add; normalise, feed forward, add (pre-norm)."""

    def __init__(self, width: int, heads: int, hidden: int) -> None:
        super().__init__()
        if width % heads:
            raise ValueError(f"a width of {width} cannot be divided among {heads} heads")
        self.heads = heads
        self.norms = nn.ModuleList(nn.LayerNorm(width) for _ in range(2))
        self.query_key_value = nn.Linear(width, 3 * width)
        self.out = nn.Linear(width, width)
        self.feed_forward = Mlp(width, hidden, width, activation=nn.GELU)

    def project(self, x: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Compute queries, keys and values of new places: (N, L, d) -> three times (N, heads, L, d / heads)."""
        flat = self.query_key_value(self.norms[0](x))
        q, k, v = flat.view(x.shape[0], x.shape[1], 3, self.heads, -1).permute(2, 0, 3, 1, 4)
        return q, k, v

    def finish(self, x: Tensor, query: Tensor, key: Tensor, value: Tensor, mask: Tensor | None) -> Tensor:
        """Finish the layer for the places of the given queries; without a mask these attend causally."""
        mixed = attend(query, key, value, mask=mask, causal=mask is None)
        x = x + self.out(mixed.transpose(1, 2).flatten(2))
        y: Tensor = x + self.feed_forward(self.norms[1](x))
        return y


class Decoder(nn.Module):
    """A stack of causal layers and a last normalisation."""

    def __init__(self, layers: int, width: int, heads: int, hidden: int) -> None:
        super().__init__()
        self.layers = nn.ModuleList(CausalLayer(width, heads, hidden) for _ in range(layers))
        self.norm = nn.LayerNorm(width)

    def forward(
        self, x: Tensor, past: Cache | None, mask: Tensor | None, *, tail: int | None = None
    ) -> tuple[Tensor, Cache]:
        """Append the places `x` (N, L, d) to the past; return (hidden states of the last places (N, tail, d), cache).

        `mask` (N, 1, L, past + L) is True where a place may look; None lets every place look at the new places up to
        itself and is for an empty past. The last layer computes only the `tail` last places (all without it; none for
        0), because no other is read.
        """
        cache: Cache = []
        last = len(self.layers) - 1
        for number, layer in enumerate(self._each()):
            query, key, value = layer.project(x)
            if past is not None:
                key = torch.cat((past[number][0], key), dim=2)
                value = torch.cat((past[number][1], value), dim=2)
            cache.append((key, value))
            if number == last and tail is not None:
                x, query = x[:, x.shape[1] - tail :], query[:, :, query.shape[2] - tail :]
                mask = None if mask is None else mask[:, :, mask.shape[2] - tail :]
            if x.shape[1]:
                x = layer.finish(x, query, key, value, mask)
        y: Tensor = self.norm(x)
        return y, cache

    def put(self, x: Tensor, room: Cache, place: Tensor, mask: Tensor) -> tuple[Tensor, Cache]:
        """Write one place `x` (N, 1, d) into a cache with room, at `place` (N,).

        Returns the place's last hidden state (N, 1, d) and the cache, which keeps its size, so that all steps have
        equal shapes. `mask` is (N, 1, 1, places), as in `forward`.
        """
        written: Cache = []
        here = (torch.arange(room[0][0].shape[2], device=x.device) == place[:, None])[:, None, :, None]
        for layer, (key, value) in zip(self._each(), room, strict=True):
            query, new_key, new_value = layer.project(x)
            key, value = torch.where(here, new_key, key), torch.where(here, new_value, value)
            written.append((key, value))
            x = layer.finish(x, query, key, value, mask)
        y: Tensor = self.norm(x)
        return y, written

    def _each(self) -> Iterator[CausalLayer]:
        for layer in self.layers:
            assert isinstance(layer, CausalLayer)
            yield layer


def select(cache: Cache, rows: Tensor) -> Cache:
    """Return the cache of the given rows, which may repeat: one image serves several prompts."""
    return [(key[rows], value[rows]) for key, value in cache]
