"""The compact UniAD's network: pictures from all around, can bus, command and memory -> waypoints and occupancy."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import torch
from torch import Tensor, nn
from torch.nn import functional

from drive_robust_agents._nets.bev_grid import BevSpec
from drive_robust_agents._nets.bev_net import DENSE_CHANNELS, BevNet
from drive_robust_agents._nets.blocks import RARE, ConvBnRelu
from drive_robust_agents._nets.manifest import spec_from
from drive_robust_agents._nets.uniad_ahead import Motions, OccupancyHead, PlannerHead, UniadMotionHead
from drive_robust_agents._nets.uniad_heads import FirstLayer, LaneHead, MapView, PriorAgents, TrackHead, Tracks

__all__ = ["Perceived", "UniadNet", "UniadSpec", "move"]

_BESIDE_PEAK = 0.25
_HEAT = len(DENSE_CHANNELS)
"""The output of a cell that is the logit of an agent's centre, behind those of its labels."""


@dataclass(frozen=True, slots=True)
class UniadSpec:
    """Sizes of a `UniadNet`: queries for agents and lanes, modes of motion, steps of 0.5 s of plan and occupancy."""

    bev: BevSpec = field(default_factory=BevSpec)
    heads: int = 4
    agents: int = 24
    lanes: int = 12
    modes: int = 3
    steps: int = 6
    occupancy_steps: int = 5


class Perceived(NamedTuple):
    """The outputs of perception, before motion and plan.

    `cells` (N, cells, d) and `view` are the map. `dense` (N, cells, 8) are logits of the labels of a cell, `heat`
    (N, cells) logits of an agent's centre. `lane_queries`, `lane_logits`, `lane_masks` are the outputs of `LaneHead`.
    """

    cells: Tensor
    view: MapView
    dense: Tensor
    heat: Tensor
    begun: FirstLayer
    tracks: Tracks
    lane_queries: Tensor
    lane_logits: Tensor
    lane_masks: Tensor


class UniadNet(BevNet):
    """Bird's-eye features, then track, lane, motion, occupancy and planner queries, each reading those before it.

    Training calls `look`, `perceive`, `foresee` and the heads; driving calls `forward`. `coarse` (cells / 4, 2) are the
    middles of the overview's cells, metres.
    """

    coarse: Tensor

    def __init__(self, spec: UniadSpec) -> None:
        super().__init__(spec.bev)
        self.spec = spec
        width, bev = spec.bev.width, spec.bev
        self.overview = ConvBnRelu(width, width, stride=2)
        self.dense = nn.Linear(width, _HEAT + 4)
        self.track = TrackHead(width, spec.heads, spec.agents)
        self.lane = LaneHead(width, spec.heads, spec.lanes)
        self.motion = UniadMotionHead(width, spec.heads, modes=spec.modes, steps=spec.steps)
        self.occupancy = OccupancyHead(width, steps=spec.occupancy_steps)
        self.planner = PlannerHead(width, spec.heads, steps=spec.steps)
        with torch.no_grad():
            self.dense.bias.fill_(RARE)
        by_four = self.centres.reshape(bev.rows // 2, 2, bev.columns // 2, 2, 2).mean(dim=(1, 3))
        self.register_buffer("coarse", by_four.flatten(0, 1), persistent=False)

    @classmethod
    def build(cls, spec: Mapping[str, Any]) -> UniadNet:
        """Return the network of a plain specification. Raises `TypeError` for one of another architecture."""
        return cls(spec_from(UniadSpec, spec))

    def example(self, rows: int) -> dict[str, Tensor]:
        """Return example inputs as for every `BevNet`, without agents from before."""
        agents = self.spec.agents
        return super().example(rows) | {
            "old_queries": torch.zeros(rows, agents, self.spec.bev.width),
            "old_spots": torch.zeros(rows, agents, 2),
        }

    def forward(
        self, images: Tensor, can_bus: Tensor, command: Tensor, motion: Tensor, known: Tensor, old_bev: Tensor,
        old_queries: Tensor, old_spots: Tensor,
    ) -> dict[str, Tensor]:  # fmt: skip
        """Compute `waypoints` (N, 6, 2) and `occupancy` (N, 5, 2 rows, 2 columns) 0..1.

        Waypoints are metres in the ego frame, 0.5 s apart.

        Also `bev`, `queries` and `spots`, to be given back 0.5 s later.
        """
        now, front = self.look(images, can_bus)
        fused = self.encoder.fusion(now, old_bev * known[:, None, None, None], motion)
        seen = self.perceive(fused, front, PriorAgents(old_queries, move(old_spots, motion), known))
        motions = self.foresee(seen)
        plan = self.plan(seen, motions, command)
        return {"waypoints": plan, "occupancy": self.occupied(seen, motions), "bev": now, **memory_of(seen.begun)}

    def look(self, images: Tensor, can_bus: Tensor) -> tuple[Tensor, Tensor]:
        """Return the map of this moment (N, d, rows, columns) and the tokens of the front camera (N, tokens, d)."""
        tokens = self.encoder.cameras(images)
        return self.encoder.lift(tokens, can_bus), tokens[:, self.spec.bev.cameras.index("front")]

    def recall(self, images: Tensor, can_bus: Tensor) -> dict[str, Tensor]:
        """Return the memory that `forward` would return for frames (N, ...) without a memory of their own."""
        now, front = self.look(images, can_bus)
        unmoved = can_bus.new_zeros(can_bus.shape[0], 3)
        cells, told, view = self._survey(self.encoder.fusion(now, torch.zeros_like(now), unmoved))
        return {"bev": now, **memory_of(self._begin(cells, told[..., _HEAT], view, front))}

    def perceive(self, fused: Tensor, front: Tensor, old: PriorAgents) -> Perceived:
        """Find agents and lanes on the fused map."""
        cells, told, view = self._survey(fused)
        heat = told[..., _HEAT]
        begun = self._begin(cells, heat, view, front)
        tracks = self.track(begun, view, old)
        return Perceived(cells, view, told[..., :_HEAT], heat, begun, tracks, *self.lane(cells, view))

    def foresee(self, seen: Perceived) -> Motions:
        """Predict the motions of agents and the ego. Boxes give the starts, but get no gradient from the motions."""
        tracks, boxes = seen.tracks, seen.tracks.boxes[1].detach()
        spots = functional.pad(boxes[..., :2], (0, 0, 1, 0))
        speed = functional.pad(boxes[..., 6], (1, 0))
        agents = torch.cat((tracks.ego, tracks.queries[1]), dim=1)
        y: Motions = self.motion(agents, speed, spots, seen.lane_queries, seen.view)
        return y

    def plan(self, seen: Perceived, motions: Motions, command: Tensor) -> Tensor:
        """Return waypoints (N, steps, 2)."""
        y: Tensor = self.planner(motions.modes[:, 0], seen.tracks.ego, command, seen.view)
        return y

    def occupied(self, seen: Perceived, motions: Motions) -> Tensor:
        """Return the probability that each cell holds a detected agent: (N, T, 2 rows, 2 columns), 0..1."""
        maps = self.occupancy(seen.cells, self.spec.bev.rows)
        whose = self.occupancy.of_agents(maps, seen.tracks.queries[1], motions.modes[:, 1:])
        believed = torch.sigmoid(seen.tracks.logits[1]).amax(dim=-1)
        return (torch.sigmoid(whose) * believed[..., None, None, None]).amax(dim=1)

    def _survey(self, fused: Tensor) -> tuple[Tensor, Tensor, MapView]:
        """Return the map as tokens, the logits of the tokens, and the overview."""
        cells = fused.flatten(2).transpose(1, 2)
        overview = self.overview(fused).flatten(2).transpose(1, 2)
        return cells, self.dense(cells), MapView(overview, self.places(self.coarse)[None], self.places)

    def _begin(self, cells: Tensor, heat: Tensor, view: MapView, front: Tensor) -> FirstLayer:
        picks = self._hottest(heat.detach())
        y: FirstLayer = self.track.begin(cells, picks, self.centres[picks], view, front)
        return y

    def _hottest(self, heat: Tensor) -> Tensor:
        """Return the cells (N, Q) with the hottest centres, local maxima before their neighbours."""
        share = torch.sigmoid(heat).reshape(heat.shape[0], self.spec.bev.rows, -1)
        peak = functional.max_pool2d(share[:, None], 3, 1, 1)[:, 0]
        worth = torch.where(share >= peak, share, _BESIDE_PEAK * share).flatten(1)
        return worth.topk(self.spec.agents, dim=1).indices


def memory_of(begun: FirstLayer) -> dict[str, Tensor]:
    """Return the agents' memory for the next inference: queries (N, Q, d) and places of the agents.

    When driving, the queries come from a map that was mixed with an older map; in training they come from a map without
    memory. The difference is 1 cm at the last waypoint, more than 3 cm in one tick of 20.
    """
    return {"queries": begun.queries[:, 1:], "spots": begun.boxes[..., :2]}


def move(spots: Tensor, motion: Tensor) -> Tensor:
    """Move points (N, Q, 2) from the old ego frame to the present ego frame; `motion` (N, 3) as in `bev.warp`."""
    away = spots - motion[:, None, :2]
    cos, sin = torch.cos(motion[:, 2])[:, None], torch.sin(motion[:, 2])[:, None]
    x, y = away[..., 0], away[..., 1]
    return torch.stack((cos * x + sin * y, cos * y - sin * x), dim=-1)
