"""The compact VAD's network: pictures from all around, a can bus, a command -> waypoints; see `VadNet`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import torch
from torch import Tensor, nn

from drive_robust_agents._nets.bev_grid import BevSpec
from drive_robust_agents._nets.bev_net import DENSE_CHANNELS, BevNet
from drive_robust_agents._nets.blocks import Mlp
from drive_robust_agents._nets.manifest import spec_from
from drive_robust_agents._nets.vad_heads import AgentHead, MapHead, PlanHead, VadMotionHead

__all__ = ["VadNet", "VadSpec", "choose"]

_COMMANDS = 6


@dataclass(frozen=True, slots=True)
class VadSpec:
    """Sizes of a `VadNet`.

    `agents` and `vectors` are the numbers of queries for road users and for map lines (of `points` points each),
    `layers` the number of decoder layers, `modes` the number of futures of an agent, `steps` the number of 0.5 s steps
    of a plan. `ego_sees_bev`: the ego query also attends to the bird's-eye features themselves.
    """

    bev: BevSpec = field(default_factory=BevSpec)
    heads: int = 4
    agents: int = 24
    vectors: int = 12
    points: int = 6
    layers: int = 2
    modes: int = 3
    steps: int = 6
    ego_sees_bev: bool = True


class VadNet(BevNet):
    """Camera features lifted to a bird's-eye grid, queries for agents and map vectors, an ego query that plans.

    Training reads `encoder` and `heads`; driving calls `forward`. `sizes` (cells, 2) are the lengths and widths of the
    map's cells, metres.
    """

    sizes: Tensor

    def __init__(self, spec: VadSpec) -> None:
        super().__init__(spec.bev)
        self.spec = spec
        width = spec.bev.width
        self.agents = AgentHead(width, spec.heads, queries=spec.agents, layers=spec.layers)
        self.map = MapHead(width, spec.heads, vectors=spec.vectors, points=spec.points, layers=spec.layers)
        self.lane_net = Mlp(2 * width, width, width)
        self.motion = VadMotionHead(width, spec.heads, modes=spec.modes, steps=spec.steps)
        self.planner = PlanHead(width, spec.heads, commands=_COMMANDS, steps=spec.steps, sees_bev=spec.ego_sees_bev)
        self.dense = nn.Linear(width, len(DENSE_CHANNELS))
        self.register_buffer("sizes", torch.from_numpy(spec.bev.sizes()).flatten(0, 1), persistent=False)

    @classmethod
    def build(cls, spec: Mapping[str, Any]) -> VadNet:
        """Return the network of a plain specification. Raises `TypeError` for one of another architecture."""
        return cls(spec_from(VadSpec, spec))

    def forward(
        self, images: Tensor, can_bus: Tensor, command: Tensor, motion: Tensor, known: Tensor, old_bev: Tensor
    ) -> dict[str, Tensor]:
        """Compute `waypoints` (N, 6, 2) and `bev` (N, d, rows, columns) to remember.

        Waypoints are metres in the ego frame, 0.5 s apart.
        """
        fused, bev = self.encoder(images, can_bus, old_bev * known[:, None, None, None], motion)
        plans = self.heads(fused)["plans"]
        return {"waypoints": choose(plans, command), "bev": bev}

    def heads(self, fused: Tensor) -> dict[str, Any]:
        """Compute all heads on the fused map (N, d, rows, columns).

        Returns `plans` (N, 6 commands, 6 steps, 2), `hints` (N, 8); per layer `agent_logits`, `boxes`, `line_logits`,
        `lines`; `paths` (N, Q, modes, 6, 2) relative to the agent's place, `path_logits` (N, Q, modes); `tokens`
        (N, cells, d) for the auxiliary `dense`.
        """
        tokens = fused.flatten(2).transpose(1, 2)
        cells = self.places(self.centres)
        points, line_logits, lines = self.map(tokens, cells, self.places)
        lanes = self.lane_net(torch.cat([points, self.places(lines[-1].detach())], dim=-1)).amax(dim=2)
        queries, agent_logits, boxes = self.agents(tokens, cells, self.places)
        place = self.places(boxes[-1][..., :2].detach())
        agents, paths, path_logits = self.motion(queries, place, lanes)
        plans, hints = self.planner(tokens, cells, agents + place, lanes)
        return {
            "plans": plans,
            "hints": hints,
            "agent_logits": agent_logits,
            "boxes": boxes,
            "line_logits": line_logits,
            "lines": lines,
            "paths": paths,
            "path_logits": path_logits,
            "tokens": tokens,
        }


def choose(plans: Tensor, command: Tensor) -> Tensor:
    """Return the plan of each row's command: (N, 6, steps, 2) and commands 1..6 (N,) -> (N, steps, 2)."""
    row = (command - 1).view(-1, 1, 1, 1).expand(-1, 1, *plans.shape[2:])
    return plans.gather(1, row)[:, 0]
