"""What the networks of UniAD and VAD begin with: a bird's-eye map, codes for places on it, and their inputs."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from drive_robust_agents._nets.attention import PointEncoding
from drive_robust_agents._nets.bev import BevEncoder
from drive_robust_agents._nets.bev_grid import BevSpec

__all__ = ["DENSE_CHANNELS", "BevNet"]

DENSE_CHANNELS = 8
"""What may lie in a cell: bodies of two kinds and lines of six, as in `training.recipes.dense.CHANNELS`."""


class BevNet(nn.Module):
    """A network that takes what `BevAgent` gives: pictures, can bus, command, and the map of 0.5 s ago.

    A subclass makes its heads after this: the order of making decides what a seed draws for whom. `centres` (cells, 2)
    are the middles of the map's cells in metres.
    """

    centres: Tensor

    def __init__(self, spec: BevSpec) -> None:
        super().__init__()
        self.encoder = BevEncoder(spec)
        self.places = PointEncoding(spec.width)
        self.register_buffer("centres", torch.from_numpy(spec.centres()).flatten(0, 1), persistent=False)

    def example(self, rows: int) -> dict[str, Tensor]:
        """Return inputs of the right shapes and types: black pictures, standing, turning left, nothing remembered."""
        bev = self.encoder.spec
        pictures = (rows, len(bev.cameras), bev.image_height_px, bev.image_width_px, 3)
        return {
            "images": torch.zeros(pictures, dtype=torch.uint8),
            "can_bus": torch.zeros(rows, 6),
            "command": torch.ones(rows, dtype=torch.int64),
            "motion": torch.zeros(rows, 3),
            "known": torch.zeros(rows),
            "old_bev": torch.zeros(rows, bev.width, bev.rows, bev.columns),
        }
