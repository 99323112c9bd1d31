"""Targets of UniAD's cells: bodies and lines drawn on the bird's-eye grid, by dots instead of distances.

A box is a lattice of dots, a line a row of dots; a cell with a dot is filled. Dots cost a thousandth of the distances
of all cells, and suit cells of different sizes. Points are metres in the ego frame (x forward, y right).
"""

from __future__ import annotations

import torch
from torch import Tensor

from drive_robust_agents._nets.bev import columns_of, rows_of
from drive_robust_agents._nets.bev_grid import BevSpec
from drive_robust_agents._nets.bev_net import LANE_CLASSES
from pytest_drive_robust.domain.truth import ActorKind

__all__ = [
    "cells_of",
    "draw",
    "from_above",
    "heat_of",
    "in_boxes",
    "occupied_by",
    "on_lines",
    "own_way",
]

_ALONG, _ASIDE = 13, 4
_DOTS = 24
_BESIDE = 0.6


def cells_of(points: Tensor, spec: BevSpec, *, finer: int = 1) -> Tensor:
    """Return the cells that hold points (..., 2): (...) int64, `cells * finer**2` for those outside or NaN."""
    rows, columns = spec.rows * finer, spec.columns * finer
    row = ((rows_of(points[..., 0], spec) + 1.0) * (0.5 * rows)).floor()
    column = ((columns_of(points[..., 1], spec) + 1.0) * (0.5 * columns)).floor()
    inside = (row >= 0.0) & (row < rows) & (column >= 0.0) & (column < columns)
    number = row * columns + column
    return torch.where(inside, number, torch.full_like(number, rows * columns)).long()


def draw(cells: Tensor, count: int) -> Tensor:
    """Return which of `count` cells hold at least one of the dots (..., dots): (..., count) of 0 and 1."""
    field = torch.zeros(*cells.shape[:-1], count + 1, device=cells.device)
    return field.scatter_(-1, cells, 1.0)[..., :count]


def in_boxes(boxes: Tensor, centres: Tensor) -> Tensor:
    """Return dots (..., B, 52, 2) in boxes (N, B, 9) moved to `centres` (N, ..., B, 2); NaN in missing boxes."""
    along = torch.linspace(-0.5, 0.5, _ALONG, device=boxes.device)
    aside = torch.linspace(-0.5, 0.5, _ASIDE, device=boxes.device)
    unit = torch.stack(torch.meshgrid(along, aside, indexing="ij"), dim=-1).flatten(0, 1)
    local = unit * boxes[:, :, None, 4:6]
    sin, cos = boxes[:, :, None, 2], boxes[:, :, None, 3]
    x, y = cos * local[..., 0] - sin * local[..., 1], sin * local[..., 0] + cos * local[..., 1]
    dots = torch.stack((x, y), dim=-1)
    missing = (boxes[..., 8] < 0.5)[..., None, None]
    dots = torch.where(missing, torch.full_like(dots, torch.nan), dots)
    extra = centres.dim() - boxes.dim()
    return dots.reshape(dots.shape[0], *[1] * extra, *dots.shape[1:]) + centres[..., None, :]


def on_lines(lanes: Tensor) -> Tensor:
    """Return dots (N, V, (P - 1) * 24, 2) along lines (N, V, P, 2)."""
    share = torch.linspace(0.0, 1.0, _DOTS, device=lanes.device)[:, None]
    start, end = lanes[:, :, :-1, None], lanes[:, :, 1:, None]
    return (start + share * (end - start)).flatten(2, 3)


def heat_of(boxes: Tensor, spec: BevSpec) -> Tensor:
    """Return (N, cells): 1 where the middle of a box is, 0.6 in the cells around it, 0 elsewhere (after CenterNet)."""
    valid = boxes[..., 8:] > 0.5
    centres = torch.where(valid, boxes[..., :2], torch.full_like(boxes[..., :2], torch.nan))
    peak = draw(cells_of(centres, spec), spec.cells).reshape(len(boxes), spec.rows, spec.columns)
    around = torch.nn.functional.max_pool2d(peak[:, None], 3, 1, 1)[:, 0]
    return torch.maximum(peak, _BESIDE * around).flatten(1)


def from_above(bodies: Tensor, lines: Tensor, boxes: Tensor, kind: Tensor) -> Tensor:
    """Return (N, 8, cells) as `DENSE_CHANNELS`.

    Takes bodies (N, B, cells) in boxes (N, B, 9) and lines (N, V, cells) by kind.
    """
    vehicle = (boxes[..., 7] <= ActorKind.EMERGENCY)[..., None]
    drawn = [bodies * vehicle, bodies * ~vehicle]
    drawn += [lines * (kind == number)[..., None] for number in range(len(LANE_CLASSES))]
    return torch.stack([layer.amax(1) for layer in drawn], dim=1)


def occupied_by(boxes: Tensor, futures: Tensor, spec: BevSpec) -> Tensor:
    """Return (N, B, 1 + T, 4 * cells), half-size cells: where each body is now and at its places (N, B, T, 2)."""
    where = torch.cat((boxes[:, :, None, :2], futures), dim=2).transpose(1, 2)
    return draw(cells_of(in_boxes(boxes, where), spec, finer=2), 4 * spec.cells).transpose(1, 2)


def own_way(boxes: Tensor, futures: Tensor) -> Tensor:
    """Return (N, B, T, 2) the ways of others: metres from their places along their own directions (forward, right)."""
    dx, dy = (futures - boxes[:, :, None, :2]).unbind(-1)
    sin, cos = boxes[:, :, None, 2], boxes[:, :, None, 3]
    return torch.stack((cos * dx + sin * dy, cos * dy - sin * dx), dim=-1)
