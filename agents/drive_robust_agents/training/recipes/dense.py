"""Dense labels: bodies and lines in each cell of the bird's-eye grid.

These labels give camera features a cheap gradient from the first step on, while the matching of queries to labels still
changes (after the segmentation heads of BEVFormer-like networks).
"""

from __future__ import annotations

import torch
from torch import Tensor
from torch.nn import functional

from drive_robust_agents._nets.bev_net import LANE_CLASSES
from pytest_drive_robust.domain.truth import ActorKind

__all__ = ["dense_loss", "dense_targets"]

_BODY_SHARE, _LINE_SHARE = 0.3, 0.55
_HEAVIER = 4.0
"""How many empty cells a filled cell counts for."""


def dense_targets(boxes: Tensor, lanes: Tensor, lane_kind: Tensor, cells: Tensor, sizes: Tensor) -> Tensor:
    """Return (N, 8, cells) of 0 and 1, by `DENSE_CHANNELS`, for centres and sizes of cells (cells, 2), metres.

    `boxes` is (N, B, 9), `lanes` (N, V, P, 2) with NaN for none, `lane_kind` (N, V), as in the samples. A body fills
    the cells whose centre it nearly covers, a line those whose centre is about half a cell away from it.
    """
    size = sizes.mean(1)
    inside = _inside(boxes, cells, _BODY_SHARE * size)
    vehicle = (boxes[..., 7] <= ActorKind.EMERGENCY)[..., None]
    bodies = [(inside & vehicle).any(1), (inside & ~vehicle).any(1)]
    near = _distance(lanes, cells) < _LINE_SHARE * size
    lines = [(near & (lane_kind == kind)[..., None]).any(1) for kind in range(len(LANE_CLASSES))]
    return torch.stack(bodies + lines, dim=1).float()


def dense_loss(logits: Tensor, targets: Tensor) -> Tensor:
    """Compute binary cross-entropy where a filled cell counts `_HEAVIER` times as much as an empty one."""
    weight = targets.new_tensor(_HEAVIER)
    return functional.binary_cross_entropy_with_logits(logits, targets, pos_weight=weight)


def _inside(boxes: Tensor, cells: Tensor, wider: Tensor) -> Tensor:
    """Return (N, B, cells): the centre of the cell lies in the body, made wider on all sides."""
    away = cells - boxes[..., None, :2]
    sin, cos = boxes[..., None, 2], boxes[..., None, 3]
    along = (cos * away[..., 0] + sin * away[..., 1]).abs()
    aside = (cos * away[..., 1] - sin * away[..., 0]).abs()
    half = boxes[..., None, 4:6] / 2.0 + wider[:, None]
    valid = boxes[..., None, 8] > 0.5
    return (along < half[..., 0]) & (aside < half[..., 1]) & valid


def _distance(lanes: Tensor, cells: Tensor) -> Tensor:
    """Return (N, V, cells) metres from each line, infinity for none."""
    nearest = lanes.new_full((*lanes.shape[:2], len(cells)), torch.inf)
    for k in range(lanes.shape[2] - 1):
        start, end = lanes[:, :, None, k], lanes[:, :, None, k + 1]
        piece = end - start
        share = ((cells - start) * piece).sum(-1) / piece.square().sum(-1).clamp(min=1e-6)
        off = (start + share.clamp(0.0, 1.0)[..., None] * piece - cells).norm(dim=-1)
        nearest = torch.minimum(nearest, off.nan_to_num(torch.inf))
    return nearest
