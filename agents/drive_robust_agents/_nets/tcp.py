"""The network of `tcp`: a compact re-implementation of TCP's trajectory branch, control branch and auxiliary heads.

Kept of TCP (Wu et al., 2022; Bench2DriveZoo `TCP/model.py`): one image encoder whose pooled feature and map are both
used; speed, target point and command as one measurement vector; a GRU that writes four waypoints half a second apart
from (last waypoint, target point); a control branch that attends to the map by the measurements, then at each of four
future steps by its own and the *trajectory's* hidden state, with Beta distributions of steering and acceleration; a
speed head that sees the image only; a value head on either branch.
Not kept: ResNet-34 with ImageNet weights (a four-stage residual net of 0.69 M parameters), the reinforcement-learnt
expert whose features and values are distilled (the values here say how free the way is, known to the simulator; there
is no feature loss).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor, nn
from torch.nn import functional

from drive_robust_agents._nets.blocks import ImageNorm, MiniResNet, Mlp
from drive_robust_agents._nets.manifest import spec_from

__all__ = ["TcpNet", "TcpSpec", "beta_mode"]

_COMMANDS = 6
_SPEED_MPS, _TARGET_M = 12.0, 20.0
"""Divisors of speeds and target points."""


@dataclass(frozen=True, slots=True)
class TcpSpec:
    """Sizes: the image in pixels, the channels of the encoder, the width of features, the waypoints."""

    height_px: int = 96
    width_px: int = 384
    widths: tuple[int, ...] = (48, 96, 192)
    stem: int = 32
    feature: int = 256
    state: int = 64
    hidden: int = 128
    steps: int = 4


class TcpNet(nn.Module):
    """1.3 M parameters.

    Rows of a batch: image uint8 (N, height, width, 3) RGB; speed float32 (N,) m/s; target float32 (N, 2) the target
    point in metres, ego frame (forward, right); command int64 (N,) `RoadOption` 1 to 6.
    """

    options: Tensor

    def __init__(self, spec: TcpSpec) -> None:
        super().__init__()
        self.spec = spec
        self.norm = ImageNorm()
        self.encoder = MiniResNet(spec.widths, stem=spec.stem)
        channels, stride = self.encoder.channels, self.encoder.total_stride
        self.cells = (spec.height_px // stride) * (spec.width_px // stride)
        self.pooled = nn.Linear(channels, spec.feature)
        self.measure = Mlp(3 + _COMMANDS + 3, spec.state, spec.state, last=True)  # three zeros: a multiple of four
        self.register_buffer("options", torch.arange(1, _COMMANDS + 1), persistent=False)
        self.speed_head = Mlp(spec.feature, 64, 1)
        self.trajectory = TrajectoryBranch(spec)
        self.controller = ControlBranch(spec, channels, self.cells)

    @classmethod
    def build(cls, spec: Mapping[str, Any]) -> TcpNet:
        """Return the network of a plain specification. Raises `TypeError` for one of another architecture."""
        return cls(spec_from(TcpSpec, spec))

    def example(self, rows: int) -> dict[str, Tensor]:
        """Return inputs of the right shapes and types: a black image, standing, the target ahead, lane following."""
        return {
            "image": torch.zeros(rows, self.spec.height_px, self.spec.width_px, 3, dtype=torch.uint8),
            "speed": torch.zeros(rows),
            "target": torch.tensor([[20.0, 0.0]]).repeat(rows, 1),
            "command": torch.full((rows,), 4),
        }

    def forward(
        self, image: Tensor, speed: Tensor, target: Tensor, command: Tensor, *, full: bool = False
    ) -> dict[str, Tensor]:
        """Compute `waypoints` (N, steps, 2) metres, ego frame, half a second apart, and `action` (N, 2).

        An action is steering -1 to 1 (right) and acceleration -1 (brake) to 1 (throttle). `full` adds outputs for
        training only: `beta` (N, 1 + steps, 2, 2), the two parameters of the distributions of steering and acceleration
        now and at each step; `speed` (N,) m/s, estimated from the image; `values` (N, 2).
        """
        features = self.encoder(self.norm(image))
        pooled = self.pooled(features.mean((2, 3)))
        state = self.measure(self._measurements(speed, target, command))
        joined = torch.cat((pooled, state), 1)
        waypoints, hidden, value = self.trajectory(joined, target)
        cells = features.flatten(2).transpose(1, 2)
        beta, control_value = self.controller(cells, state, hidden if full else None)
        outputs: dict[str, Tensor] = {"waypoints": waypoints, "action": 2.0 * beta_mode(beta[:, 0]) - 1.0}
        if full:
            outputs["beta"] = beta
            outputs["speed"] = self.speed_head(pooled)[:, 0] * _SPEED_MPS
            outputs["values"] = torch.cat((value, control_value), 1)
        return outputs

    def _measurements(self, speed: Tensor, target: Tensor, command: Tensor) -> Tensor:
        one_hot = (command[:, None] == self.options).to(target.dtype)
        known = (speed[:, None] / _SPEED_MPS, target / _TARGET_M, one_hot)
        return functional.pad(torch.cat(known, 1), (0, 3))


class TrajectoryBranch(nn.Module):
    """Predicts waypoints one after the other, each from the last waypoint and the target point, and a value."""

    def __init__(self, spec: TcpSpec) -> None:
        super().__init__()
        self.steps = spec.steps
        self.join = Mlp(spec.feature + spec.state, 256, spec.hidden, last=True)
        self.value = Mlp(spec.hidden, 64, 1)
        self.cell = nn.GRUCell(4, spec.hidden)
        self.delta = nn.Linear(spec.hidden, 2)

    def forward(self, joined: Tensor, target: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Write waypoints from `joined` (N, feature + state) and the target (N, 2) in metres.

        Gives waypoints (N, steps, 2) in metres, hidden states (N, steps, hidden), the value (N, 1).
        """
        hidden = self.join(joined)
        value = self.value(hidden)
        point = torch.zeros_like(target)
        goal = target / _TARGET_M
        points, states = [], []
        for _ in range(self.steps):
            hidden = self.cell(torch.cat((point / _TARGET_M, goal), 1), hidden)
            point = point + self.delta(hidden)
            points.append(point)
            states.append(hidden)
        return torch.stack(points, 1), torch.stack(states, 1), value


class ControlBranch(nn.Module):
    """Predicts distributions of pedals and steering, now and (trajectory-guided, in training) at each future step."""

    def __init__(self, spec: TcpSpec, channels: int, cells: int) -> None:
        super().__init__()
        hidden = spec.hidden
        self.look = Mlp(spec.state, 64, cells)
        self.join = Mlp(channels + spec.state, 256, hidden, last=True)
        self.value = Mlp(hidden, 64, 1)
        self.policy = Mlp(hidden, 64, 4)
        self.cell = nn.GRUCell(hidden + 4, hidden)
        self.guided_look = Mlp(2 * hidden, 64, cells)
        self.merge = Mlp(hidden + channels, 256, hidden)

    def forward(self, cells: Tensor, state: Tensor, guides: Tensor | None) -> tuple[Tensor, Tensor]:
        """Read the map (N, cells, channels), measurements, and hidden states of the trajectory (None: only now).

        Gives the Beta parameters (N, 1 or 1 + steps, 2, 2) and the value (N, 1).
        """
        feature = self.join(torch.cat((_attended(cells, self.look(state)), state), 1))
        value = self.value(feature)
        policies = [self._beta(feature)]
        hidden = torch.zeros_like(feature)
        for guide in () if guides is None else guides.unbind(1):
            hidden = self.cell(torch.cat((feature, policies[-1].log().flatten(1)), 1), hidden)
            seen = _attended(cells, self.guided_look(torch.cat((hidden, guide), 1)))
            feature = feature + self.merge(torch.cat((hidden, seen), 1))
            policies.append(self._beta(feature))
        return torch.stack(policies, 1), value

    def _beta(self, feature: Tensor) -> Tensor:
        """Return (N, 2, 2): (steering, acceleration) x (alpha, beta), both above one, which gives a single mode."""
        raw: Tensor = self.policy(feature)
        return functional.softplus(raw).view(-1, 2, 2) + 1.0


def beta_mode(parameters: Tensor) -> Tensor:
    """Return the most likely value, 0 to 1, of Beta distributions (..., 2) whose parameters exceed one."""
    alpha, beta = parameters.unbind(-1)
    return (alpha - 1.0) / (alpha + beta - 2.0).clamp_min(1e-6)


def _attended(cells: Tensor, logits: Tensor) -> Tensor:
    """Average the cells (N, cells, channels) by the softmax of the logits (N, cells): (N, channels)."""
    return (cells * logits.softmax(1)[:, :, None]).sum(1)
