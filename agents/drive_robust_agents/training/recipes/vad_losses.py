"""The losses of VAD's sets of queries (agents, their paths, map vectors), each matched to labels at least cost.

Shapes as in the samples: boxes (N, B, 9), futures (N, B, T, 2), lanes (N, V, P, 2), kinds (N, V); metres, ego frame.
Weights are the published ones (focal 2, L1 0.25 on boxes, 0.2 on paths), per positive, as a mean over the layers;
points of lines count 0.1 a metre (published: 1, of points divided by the range of the map).
"""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor
from torch.nn import functional

from drive_robust_agents._nets.matching import Match, match
from pytest_drive_robust.domain.truth import ActorKind

__all__ = ["agent_loss", "box_labels", "class_of", "focal", "focal_cost", "lane_loss", "path_loss"]

_FOCAL, _BOX, _LINE, _TURN, _PATH = 2.0, 0.25, 0.1, 0.005, 0.2
_NUMBERS = 7


def focal(logits: Tensor, targets: Tensor, *, alpha: float = 0.25, gamma: float = 2.0) -> Tensor:
    """Return the focal loss of 0/1 targets (Lin et al. 2017), summed."""
    entropy = functional.binary_cross_entropy_with_logits(logits, targets, reduction="none")
    p = logits.sigmoid()
    wrong = targets + p - 2.0 * targets * p
    weight = (alpha * targets + (1.0 - alpha) * (1.0 - targets)) * wrong**gamma
    return (weight * entropy).sum()


def focal_cost(logits: Tensor, classes: Tensor, *, alpha: float = 0.25, gamma: float = 2.0) -> Tensor:
    """Return the cost of a query (N, Q, C) being of a class (N, T): (N, Q, T)."""
    p = logits.sigmoid()
    here = -alpha * (1.0 - p) ** gamma * functional.logsigmoid(logits)
    not_here = -(1.0 - alpha) * p**gamma * functional.logsigmoid(-logits)
    return (here - not_here).gather(2, classes[:, None].expand(-1, logits.shape[1], -1))


def class_of(kind: Tensor) -> Tensor:
    """Return the class of agent queries for `ActorKind`s: 0 vehicle, 1 bicycle, 2 pedestrian, 3 obstacle."""
    plain = torch.full_like(kind, 3)
    plain = torch.where(kind == ActorKind.PEDESTRIAN, torch.full_like(kind, 2), plain)
    plain = torch.where(kind == ActorKind.BICYCLE, torch.full_like(kind, 1), plain)
    return torch.where(kind < ActorKind.BICYCLE, torch.zeros_like(kind), plain).long()


def box_labels(boxes: Tensor) -> Tensor:
    """Return (N, B, 7) in the agent head's terms: x, y, sin, cos, log length, log width, speed."""
    return torch.cat([boxes[..., :4], boxes[..., 4:6].clamp(min=0.1).log(), boxes[..., 6:7]], dim=-1)


def agent_loss(logits: Sequence[Tensor], boxes: Sequence[Tensor], target: Tensor) -> tuple[Tensor, Tensor, Match]:
    """Return (class loss, box loss, the match of the last layer). Speeds count a fifth, as published."""
    classes, labels, valid = class_of(target[..., 7]), box_labels(target), target[..., 8] > 0.5
    weight = labels.new_tensor([1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 0.2])
    kind_loss, box_loss = labels.new_zeros(()), labels.new_zeros(())
    for told, shape in zip(logits, boxes, strict=True):
        with torch.no_grad():
            off = (shape[:, :, None, :_NUMBERS] - labels[:, None]) * weight
            found = match(_FOCAL * focal_cost(told, classes) + _BOX * off.abs().sum(-1), valid)
        count = max(len(found.rows), 1)
        wanted = torch.zeros_like(told)
        wanted[found.rows, found.queries, classes[found.rows, found.targets]] = 1.0
        kind_loss = kind_loss + focal(told, wanted) / count
        off = shape[found.rows, found.queries, :_NUMBERS] - labels[found.rows, found.targets]
        box_loss = box_loss + (off * weight).abs().sum() / count
    return _FOCAL * kind_loss / len(logits), _BOX * box_loss / len(logits), found


def path_loss(paths: Tensor, logits: Tensor, target: Tensor, futures: Tensor, found: Match) -> Tensor:
    """Compute the loss of the best mode of (N, Q, M, T, 2): it learns the agent's way, and to be the likeliest."""
    future = futures[found.rows, found.targets] - target[found.rows, found.targets, None, :2]
    there = ~future.isnan().any(-1)
    off = (paths[found.rows, found.queries] - future.nan_to_num(0.0)[:, None]).abs().sum(-1) * there[:, None]
    off = off.sum(-1) / there.sum(-1).clamp(min=1)[:, None]
    seen = there.any(-1)
    best = off.detach().argmin(1)
    way = off.gather(1, best[:, None])[:, 0]
    choice = functional.cross_entropy(logits[found.rows, found.queries], best, reduction="none")
    return _PATH * ((way + choice) * seen).sum() / seen.sum().clamp(min=1)


def lane_loss(logits: Sequence[Tensor], lines: Sequence[Tensor], target: Tensor, kind: Tensor) -> tuple[Tensor, Tensor]:
    """Return (class loss, points loss): L1 of the points in the better order, and the cosine of their directions."""
    valid = kind >= 0
    classes = kind.clamp(min=0).long()
    both = torch.stack([target, target.flip(2)], dim=2).nan_to_num(0.0)
    kind_loss, point_loss = target.new_zeros(()), target.new_zeros(())
    for told, line in zip(logits, lines, strict=True):
        with torch.no_grad():
            off = (line[:, :, None, None] - both[:, None]).abs().sum(-1).mean(-1)
            least, order = off.min(-1)
            found = match(_FOCAL * focal_cost(told, classes) + _LINE * least, valid)
        count = max(len(found.rows), 1)
        wanted = torch.zeros_like(told)
        wanted[found.rows, found.queries, classes[found.rows, found.targets]] = 1.0
        kind_loss = kind_loss + focal(told, wanted) / count
        mine = line[found.rows, found.queries]
        label = both[found.rows, found.targets, order[found.rows, found.queries, found.targets]]
        turn = 1.0 - functional.cosine_similarity(mine.diff(dim=1), label.diff(dim=1), dim=-1)
        off_m = (mine - label).abs().sum(-1).mean(-1)
        point_loss = point_loss + (_LINE * off_m + _TURN * turn.mean(-1)).sum() / count
    return _FOCAL * kind_loss / len(logits), point_loss / len(logits)
