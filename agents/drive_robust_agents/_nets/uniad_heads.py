"""The perception heads of the compact UniAD: tracks and lanes, each a set of queries on the bird's-eye map.

Everything is in the ego frame (x forward, y right), metres and m/s. `cells` are tokens (N, cells, d) of the bird's-eye
map. Queries attend to a `MapView`, which holds tokens of this map at half the resolution.
Outputs are padded to multiples of four numbers, so that the bits of a row do not depend on other rows.
"""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor, nn

from drive_robust_agents._nets.attention import CrossLayer, DecoderLayer, PointEncoding
from drive_robust_agents._nets.blocks import Mlp, mostly_nothing

__all__ = ["FirstLayer", "LaneHead", "MapView", "PriorAgents", "TrackHead", "Tracks"]

_NEAR_M, _SPEED_MPS = 4.0, 8.0
_HIDDEN = -1.0e4


class PriorAgents(NamedTuple):
    """Agents known from 0.5 s ago: queries (N, Q, d), places (N, Q, 2) in the present ego frame, valid rows (N,)."""

    queries: Tensor
    spots: Tensor
    known: Tensor


class MapView(NamedTuple):
    """The `overview` tokens (N, K, d), the codes of their places (1, K, d), and the encoder of places."""

    tokens: Tensor
    code: Tensor
    places: PointEncoding


class FirstLayer(NamedTuple):
    """Outputs of the first layer: queries (N, 1 + Q, d), the ego's first; class logits (N, Q, 4); boxes (N, Q, 8)."""

    queries: Tensor
    logits: Tensor
    boxes: Tensor


class Tracks(NamedTuple):
    """Outputs of both layers: `logits` (N, Q, 4), `boxes` (N, Q, 8), `queries` (N, Q, d); the ego's query (N, 1, d).

    A box is x, y, sin yaw, cos yaw, log length, log width, speed, and an unused number. `hints` (N, 8) are read from
    the ego's query, to teach this query the facts that matter to a driver: five logits of the light ahead, and the
    nearness of the light's line, of a leader, and of a body in the way.
    """

    logits: tuple[Tensor, Tensor]
    boxes: tuple[Tensor, Tensor]
    queries: tuple[Tensor, Tensor]
    ego: Tensor
    hints: Tensor


class TrackHead(nn.Module):
    """One query for each agent and one for the ego, with the queries of 0.5 s ago as memory.

    Queries begin at the hottest cells of the heat map of centres (one cell each, a local maximum before its
    neighbours), with the feature of the cell. After a first layer, the old queries are propagated: each looks again at
    the map around its old place (the query interaction module). The second layer of the new queries looks at the map
    and at the propagated queries.
    """

    def __init__(self, width: int, heads: int, queries: int) -> None:
        super().__init__()
        self.count = queries
        self.start = nn.Linear(width, width)
        self.ego = nn.Parameter(torch.randn(1, 1, width) * 0.1)
        self.front = CrossLayer(width, heads)
        self.first, self.propagate, self.second = (DecoderLayer(width, heads) for _ in range(3))
        self.boxes = nn.ModuleList(mostly_nothing(Mlp(width, width, 12), 4) for _ in range(2))
        self.hints = Mlp(width, width, 8)

    def begin(self, cells: Tensor, picks: Tensor, spots: Tensor, view: MapView, front: Tensor) -> FirstLayer:
        """Run the first layer on one picture alone: `picks` (N, Q) are cells and `spots` (N, Q, 2) their middles."""
        newborn = self.start(cells.gather(1, picks[..., None].expand(-1, -1, cells.shape[-1])))
        ego = self.front(self.ego.expand(cells.shape[0], -1, -1), front)
        places = view.places
        here = torch.cat((places(torch.zeros_like(spots[:, :1])), places(spots)), dim=1)
        query = torch.cat((ego, newborn), dim=1)
        query = self.first(query, view.tokens, query_position=here, memory_position=view.code)
        return FirstLayer(query, *self._read(0, query[:, 1:], spots))

    def forward(self, begun: FirstLayer, view: MapView, old: PriorAgents) -> Tracks:
        """Refine the queries with the agents known from 0.5 s ago."""
        places, spots = view.places, begun.boxes[..., :2].detach()
        there = places(old.spots)
        kept = self.propagate(old.queries, view.tokens, query_position=there, memory_position=view.code)
        hidden = (1.0 - old.known)[:, None].expand(-1, self.count) * _HIDDEN
        mask = torch.cat((torch.zeros_like(view.tokens[..., 0]), hidden), dim=1)[:, None, None]
        query = self.second(
            begun.queries,
            torch.cat((view.tokens, kept), dim=1),
            query_position=torch.cat((places(torch.zeros_like(spots[:, :1])), places(spots)), dim=1),
            memory_position=torch.cat((view.code.expand(kept.shape[0], -1, -1), there), dim=1),
            memory_mask=mask,
        )
        one, two = begun.queries[:, 1:], query[:, 1:]
        logits, boxes = self._read(1, two, spots)
        return Tracks((begun.logits, logits), (begun.boxes, boxes), (one, two), query[:, :1], self.hints(query[:, 0]))

    def _read(self, layer: int, query: Tensor, spots: Tensor) -> tuple[Tensor, Tensor]:
        told = self.boxes[layer](query)
        spot = spots + _NEAR_M * told[..., 4:6]
        return told[..., :4], torch.cat((spot, told[..., 6:10], _SPEED_MPS * told[..., 10:11], told[..., 11:]), dim=-1)


class LaneHead(nn.Module):
    """Queries for the lines of the map: a class each, and a mask by its product with the cells (as Panoptic SegFormer).

    Returns queries (N, V, d), class logits (N, V, 8, the first six of `LANE_CLASSES`) and mask logits (N, V, cells).
    """

    def __init__(self, width: int, heads: int, queries: int) -> None:
        super().__init__()
        self.content = nn.Parameter(torch.randn(queries, width) * 0.5)
        self.layer = DecoderLayer(width, heads)
        self.classes = mostly_nothing(Mlp(width, width, 8), 8)
        self.mask, self.paint = Mlp(width, width, width), nn.Linear(width, width)

    def forward(self, cells: Tensor, view: MapView) -> tuple[Tensor, Tensor, Tensor]:
        """Return lane queries, class logits and mask logits from the map."""
        start = self.content.expand(cells.shape[0], -1, -1)
        query = self.layer(start, view.tokens, query_position=start, memory_position=view.code)
        masks = self.mask(query) @ self.paint(cells).transpose(1, 2) * cells.shape[-1] ** -0.5
        return query, self.classes(query), masks - 2.0
