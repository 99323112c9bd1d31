"""The heads of the compact UniAD that look ahead: motion, occupancy and the plan, in this order.

Everything is in the ego frame (x forward, y right), metres and m/s; a `MapView` holds tokens of the map below. Outputs
are padded to multiples of four numbers, so that the bits of a row do not depend on other rows.
"""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor, nn

from drive_robust_agents._nets.attention import CrossLayer
from drive_robust_agents._nets.blocks import ConvBnRelu, Mlp
from drive_robust_agents._nets.uniad_heads import MapView

__all__ = ["Motions", "OccupancyHead", "PlannerHead", "UniadMotionHead"]

_STEP_M, _STEP_S = 4.0, 0.5


class Motions(NamedTuple):
    """Motions, the ego's first: `modes` (N, 1 + Q, M, d), `paths` (N, 1 + Q, M, T, 2), `spread` (... 3), `logits`.

    Paths are metres from the agent's place along its own directions (forward, right). `spread` holds the logarithms of
    both deviations and the inverse hyperbolic tangent of their correlation.
    """

    modes: Tensor
    paths: Tensor
    spread: Tensor
    logits: Tensor


class UniadMotionHead(nn.Module):
    """Predicts motions of each agent: modes that look at agents, lanes and map, as deviations from constant speed."""

    def __init__(self, width: int, heads: int, *, modes: int, steps: int) -> None:
        super().__init__()
        self.modes, self.steps = modes, steps
        self.mode = nn.Parameter(torch.randn(1, 1, modes, width) * 0.3)
        self.agents, self.lanes, self.view = (CrossLayer(width, heads) for _ in range(3))
        self.outputs = 4 * ((5 * steps + 1 + 3) // 4)
        self.path = Mlp(width, width, self.outputs)

    def forward(self, agents: Tensor, speed: Tensor, spots: Tensor, lanes: Tensor, view: MapView) -> Motions:
        """Predict motions of `agents` (N, 1 + Q, d) with `speed` (N, 1 + Q) [m/s] and `spots` (N, 1 + Q, 2).

        A speed of 0 leaves the whole path to the network.
        """
        placed = agents + view.places(spots)
        query = (placed.unsqueeze(2) + self.mode).flatten(1, 2)
        query = self.lanes(self.agents(query, placed, agents), lanes)
        query = self.view(query, view.tokens + view.code, view.tokens)
        told: Tensor = self.path(query).reshape(query.shape[0], -1, self.modes, self.outputs)
        steps = told[..., : 5 * self.steps].reshape(*told.shape[:3], self.steps, 5)
        time_s = _STEP_S * torch.arange(1, self.steps + 1, device=agents.device, dtype=agents.dtype)
        ahead = speed[..., None, None] * time_s
        steady = torch.stack((ahead, torch.zeros_like(ahead)), dim=-1)
        paths = steady + (_STEP_M * steps[..., :2]).cumsum(dim=-2)
        modes = query.reshape(*told.shape[:3], -1)
        return Motions(modes, paths, steps[..., 2:], told[..., 5 * self.steps])


class OccupancyHead(nn.Module):
    """Predicts occupancy, now and every 0.5 s, on cells of half the size.

    A small map is carried forward by one residual convolution per step. The logit of an agent is the product of its
    query with the cell, plus the cell's logit for any agent.
    """

    def __init__(self, width: int, *, steps: int, inputs: int = 32, features: int = 16) -> None:
        super().__init__()
        self.features = features
        self.enter = nn.Linear(width, inputs)
        self.step = nn.ModuleList(ConvBnRelu(inputs, inputs) for _ in range(steps - 1))
        self.finer = nn.ConvTranspose2d(inputs, features + 4, 2, stride=2)
        self.agent = Mlp(2 * width, width, features)

    def forward(self, cells: Tensor, rows: int) -> Tensor:
        """Compute maps (N, T, features + 4, 2 rows, 2 columns) of a bird's-eye map with so many rows."""
        entered: Tensor = self.enter(cells)
        state = entered.reshape(cells.shape[0], rows, -1, entered.shape[2]).permute(0, 3, 1, 2)
        states = [state]
        for step in self.step:
            states.append(states[-1] + step(states[-1]))
        together = torch.stack(states, dim=1).flatten(0, 1).contiguous(memory_format=torch.channels_last)
        y: Tensor = self.finer(together)
        return y.reshape(cells.shape[0], -1, *y.shape[1:])

    def anyone(self, maps: Tensor) -> Tensor:
        """Return logits (N, T, rows, columns) that a cell is occupied by any agent."""
        return maps[:, :, self.features]

    def of_agents(self, maps: Tensor, agents: Tensor, modes: Tensor) -> Tensor:
        """Return logits (N, Q, T, rows, columns) of agents (N, Q, d) with modes (N, Q, M, d)."""
        wanted = self.agent(torch.cat((agents, modes.amax(dim=2)), dim=-1))
        n, steps, _, rows, columns = maps.shape
        flat = maps[:, :, : self.features].transpose(1, 2).flatten(2)
        product: Tensor = (wanted @ flat).view(n, -1, steps, rows, columns)
        return product + self.anyone(maps)[:, None]


class PlannerHead(nn.Module):
    """Plans from the ego's motion modes, its track query (without gradient) and the command.

    As UniAD's planning head: fused by a linear layer, reduced by the maximum over modes, layers of attention to the
    map (two of three), offsets that are summed up.
    """

    def __init__(self, width: int, heads: int, *, steps: int) -> None:
        super().__init__()
        self.steps = steps
        self.command = nn.Embedding(8, width)
        self.fuse = nn.Sequential(nn.Linear(3 * width, width), nn.LayerNorm(width), nn.ReLU())
        self.layers = nn.ModuleList(CrossLayer(width, heads) for _ in range(2))
        self.offsets = Mlp(width, width, 2 * steps)

    def forward(self, modes: Tensor, ego: Tensor, command: Tensor, view: MapView) -> Tensor:
        """Plan waypoints (N, T, 2) from modes (N, M, d), the track query (N, 1, d) and commands (N,) of 1 to 6."""
        parts = (modes, ego.detach().expand_as(modes), self.command(command)[:, None].expand_as(modes))
        query = self.fuse(torch.cat(parts, dim=-1)).amax(dim=1, keepdim=True)
        for layer in self.layers:
            query = layer(query, view.tokens + view.code, view.tokens)
        offsets: Tensor = self.offsets(query[:, 0])
        return (_STEP_M * offsets.reshape(offsets.shape[0], self.steps, 2)).cumsum(dim=1)
