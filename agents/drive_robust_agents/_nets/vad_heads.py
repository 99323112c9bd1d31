"""The heads of the compact VAD: agents, map vectors, motion and plan, each a set of queries.

Everything is in the ego frame (x forward, y right), metres and m/s. A head takes the bird's-eye features as tokens
(N, cells, d). Outputs are padded to multiples of four numbers, so that the bits of a row do not depend on other rows.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

from drive_robust_agents._nets.attention import Attention, CrossLayer, DecoderLayer, PointEncoding
from drive_robust_agents._nets.bev_net import LANE_CLASSES
from drive_robust_agents._nets.blocks import Mlp, mostly_nothing

__all__ = ["AgentHead", "MapHead", "PlanHead", "VadMotionHead"]

_STEP_M, _NEAR_M, _SPEED_MPS = 4.0, 8.0, 8.0


class AgentHead(nn.Module):
    """Queries for other road users, each with its own anchor, which every layer moves for the next layer."""

    def __init__(self, width: int, heads: int, *, queries: int, layers: int) -> None:
        super().__init__()
        self.content = nn.Parameter(torch.randn(queries, width) * 0.1)
        self.anchors = nn.Parameter(_grid(queries) / _NEAR_M)
        self.layers = nn.ModuleList(DecoderLayer(width, heads) for _ in range(layers))
        self.boxes = nn.ModuleList(mostly_nothing(Mlp(width, width, 12), 4) for _ in range(layers))

    def forward(self, bev: Tensor, cells: Tensor, places: PointEncoding) -> tuple[Tensor, list[Tensor], list[Tensor]]:
        """Return (queries (N, Q, d), class logits (N, Q, 4) of each layer, boxes (N, Q, 8) of each layer).

        A box is x, y, sin yaw, cos yaw, log length, log width, speed, and an unused number.
        """
        rows = bev.shape[0]
        query = self.content.expand(rows, -1, -1)
        anchors = (_NEAR_M * self.anchors).expand(rows, -1, -1)
        logits, boxes = [], []
        for layer, head in zip(self.layers, self.boxes, strict=True):
            query = layer(query, bev, query_position=places(anchors), memory_position=cells)
            told: Tensor = head(query)
            spot = anchors + _NEAR_M * told[..., 4:6]
            box = torch.cat([spot, told[..., 6:10], _SPEED_MPS * told[..., 10:11], told[..., 11:]], dim=-1)
            logits.append(told[..., :4])
            boxes.append(box)
            anchors = spot.detach()
        return query, logits, boxes


class MapHead(nn.Module):
    """Queries for map lines: an instance embedding plus a point embedding is the query of one point of one line."""

    def __init__(self, width: int, heads: int, *, vectors: int, points: int, layers: int) -> None:
        super().__init__()
        self.vectors, self.points = vectors, points
        self.instance = nn.Parameter(torch.randn(vectors, 1, width) * 0.1)
        self.point = nn.Parameter(torch.randn(1, points, width) * 0.1)
        self.anchors = nn.Parameter(_lines(vectors, points) / _NEAR_M)
        self.layers = nn.ModuleList(DecoderLayer(width, heads) for _ in range(layers))
        self.moves = nn.ModuleList(Mlp(width, width, 4) for _ in range(layers))
        self.classes = nn.ModuleList(mostly_nothing(Mlp(width, width, 8), 8) for _ in range(layers))

    def forward(self, bev: Tensor, cells: Tensor, places: PointEncoding) -> tuple[Tensor, list[Tensor], list[Tensor]]:
        """Return (point queries (N, V, P, d), class logits (N, V, 6), points (N, V, P, 2) in metres), per layer."""
        rows = bev.shape[0]
        query: Tensor = (self.instance + self.point).flatten(0, 1).expand(rows, -1, -1)
        anchors = (_NEAR_M * self.anchors).flatten(0, 1).expand(rows, -1, -1)
        logits, lines = [], []
        for layer, move, classify in zip(self.layers, self.moves, self.classes, strict=True):
            query = layer(query, bev, query_position=places(anchors), memory_position=cells)
            spot: Tensor = anchors + _NEAR_M * move(query)[..., :2]
            vectors = query.view(-1, self.vectors, self.points, query.shape[-1])
            logits.append(classify(vectors.mean(dim=2))[..., : len(LANE_CLASSES)])
            lines.append(spot.view(-1, self.vectors, self.points, 2))
            anchors = spot.detach()
        return query.view(-1, self.vectors, self.points, query.shape[-1]), logits, lines


class VadMotionHead(nn.Module):
    """Predicts motions of agents: modes are queries that attend to one another and to the lanes."""

    def __init__(self, width: int, heads: int, *, modes: int, steps: int) -> None:
        super().__init__()
        self.steps = steps
        self.mode = nn.Parameter(torch.randn(1, 1, modes, width) * 0.1)
        self.among = Attention(width, heads)
        self.norm = nn.LayerNorm(width)
        self.lanes = CrossLayer(width, heads)
        self.path = Mlp(2 * width, width, 2 * steps)
        self.likely = Mlp(2 * width, width, 4)
        self.fuse = Mlp(2 * width * modes, width, width)

    def forward(self, agents: Tensor, place: Tensor, lanes: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Return (agents with their modes fused (N, Q, d), paths (N, Q, M, steps, 2), mode logits (N, Q, M)).

        Paths are metres from the agent's place, in the directions of the ego frame. `place` (N, Q, d) and `lanes`
        (N, V, d) carry the codes of their places.
        """
        modes = (agents + place).unsqueeze(2) + self.mode
        query = modes.flatten(1, 2)
        query = self.norm(query + self.among(query))
        seen = self.lanes(query, lanes).unflatten(1, modes.shape[1:3])
        both = torch.cat([agents.unsqueeze(2).expand_as(seen), seen], dim=-1)
        steps: Tensor = _STEP_M * self.path(both)
        paths = steps.view(-1, *both.shape[1:3], self.steps, 2).cumsum(dim=-2)
        return self.fuse(both.flatten(2)), paths, self.likely(both)[..., 0]


class PlanHead(nn.Module):
    """Plans for each command by an ego query that attends to the bird's-eye map, to agents and to lanes.

    Neither the speed nor the command is an input: the command only chooses among the plans.
    """

    def __init__(self, width: int, heads: int, *, commands: int, steps: int, sees_bev: bool) -> None:
        super().__init__()
        self.shape = (commands, steps, 2)
        self.ego = nn.Parameter(torch.randn(1, 1, width) * 0.1)
        self.overview = CrossLayer(width, heads) if sees_bev else None
        self.agents, self.lanes = CrossLayer(width, heads), CrossLayer(width, heads)
        self.plans = Mlp(2 * width, 2 * width, commands * steps * 2)
        self.hints = Mlp(2 * width, width, 8)

    def forward(self, bev: Tensor, cells: Tensor, agents: Tensor, lanes: Tensor) -> tuple[Tensor, Tensor]:
        """Return plans (N, commands, steps, 2), metres in the ego frame, and hints (N, 8).

        `agents` and `lanes` carry the codes of their places.

        Hints are the ego's estimates of the light (5 logits: none, green, yellow, red, stop sign) and of the nearness
        of a stop line, a leader and an obstacle (1 here, 0 far away); for training only.
        """
        ego = self.ego.expand(bev.shape[0], -1, -1)
        if self.overview is not None:
            ego = self.overview(ego, bev + cells, bev)
        beside = self.agents(ego, agents)
        along = self.lanes(beside, lanes)
        known = torch.cat([beside, along], dim=-1).flatten(1)
        offsets: Tensor = self.plans(known)
        return (_STEP_M * offsets).view(-1, *self.shape).cumsum(dim=-2), self.hints(known)


def _grid(queries: int) -> Tensor:
    """Return anchors (queries, 2) in metres: rows of four from behind the ego to far ahead, denser near the ego."""
    rows = -(-queries // 4)
    x = torch.linspace(0.0, 1.0, rows) ** 1.5 * 64.0 - 10.0
    y = torch.tensor([-9.0, -3.0, 3.0, 9.0])
    return torch.stack(torch.meshgrid(x, y, indexing="ij"), dim=-1).flatten(0, 1)[:queries].clone()


def _lines(vectors: int, points: int) -> Tensor:
    """Return line anchors (vectors, points, 2) in metres: a third lie across the road, the others along it."""
    across = vectors // 3
    t = torch.linspace(0.0, 1.0, points)
    sides = torch.linspace(-10.0, 10.0, vectors - across)
    ahead = torch.linspace(8.0, 44.0, max(across, 1))
    along = [torch.stack([t * 56.0 - 8.0, torch.full_like(t, float(y))], dim=-1) for y in sides]
    cross = [torch.stack([torch.full_like(t, float(x)), t * 12.0 - 6.0], dim=-1) for x in ahead[:across]]
    return torch.stack(along + cross)
