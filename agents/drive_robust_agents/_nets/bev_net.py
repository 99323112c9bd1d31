"""The common base of UniAD's and VAD's networks: a bird's-eye map, codes of its places, and the inputs."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from drive_robust_agents._nets.attention import PointEncoding
from drive_robust_agents._nets.bev import BevEncoder
from drive_robust_agents._nets.bev_grid import BevSpec

__all__ = ["DENSE_CHANNELS", "LANE_CLASSES", "BevNet"]

LANE_CLASSES = ("route", "lane", "striped edge", "solid edge", "stop line", "crosswalk")
"""The kinds of lines of the map, in the order of `lane_kind` (`training.data.perception`)."""
DENSE_CHANNELS = ("vehicle", "other", *LANE_CLASSES)
"""The labels of a cell: two kinds of bodies, and lines."""


class BevNet(nn.Module):
    """A network with the inputs of `BevAgent`: pictures, can bus, command, and the map of 0.5 s ago.

    A subclass constructs its heads after this constructor, because the order of construction decides the random initial
    weights of a seed. `centres` (cells, 2) are the middles of the map's cells in metres.
    """

    centres: Tensor

    def __init__(self, spec: BevSpec) -> None:
        super().__init__()
        self.encoder = BevEncoder(spec)
        self.places = PointEncoding(spec.width)
        self.register_buffer("centres", torch.from_numpy(spec.centres()).flatten(0, 1), persistent=False)

    def example(self, rows: int) -> dict[str, Tensor]:
        """Return example inputs of the right shapes and types: black pictures, standing, turning left, no memory."""
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
