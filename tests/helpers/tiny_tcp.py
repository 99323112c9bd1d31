"""TCP so small that a test trains it in no time, and published weights of it."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

import torch

from drive_robust_agents._nets.tcp import TcpNet, TcpSpec
from drive_robust_agents.training.loop.export import write_weights
from drive_robust_agents.training.loop.trainer import TrainingOptions

SPEC = TcpSpec(height_px=32, width_px=48, widths=(8, 8), stem=8, feature=16, state=16, hidden=16)
CAMERAS = {"front_left": (32, 20), "front": (32, 20), "front_right": (32, 20)}


def tiny_net(seed: int = 0) -> TcpNet:
    torch.manual_seed(seed)
    return TcpNet(SPEC)


def tiny_options(*, steps: int = 12, batch: int = 8, **changes: object) -> TrainingOptions:
    return TrainingOptions(
        agent="tcp", steps=steps, batch=batch, lr=3e-3, weight_decay=0.01, clip=1.0, spec=asdict(SPEC), **changes
    )


def published(folder: Path, *, seed: int = 0) -> Path:
    """Write weights of a network that has seen some images, so that its statistics are no round numbers."""
    net = tiny_net(seed).train()
    inputs = net.example(4)
    inputs["image"] = torch.randint(0, 256, inputs["image"].shape, dtype=torch.uint8)
    net(**inputs)
    return write_weights(net.eval(), folder, options=tiny_options(), step=12)
