"""The losses that UniAD and VAD share: agents matched to boxes at least cost, and hints to the ego's query.

Boxes are (N, B, 9), as in the samples: metres, ego frame. Weights are the published ones (focal 2, L1 0.25 on boxes),
per positive, as a mean over the layers.
"""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor
from torch.nn import functional

from drive_robust_agents.training.data.facts import FACTS
from drive_robust_agents.training.recipes.matching import Match, match
from pytest_drive_robust.domain.truth import ActorKind

__all__ = ["FOCAL", "agent_loss", "box_labels", "class_loss", "class_of", "focal_cost", "hint_loss"]

FOCAL = 2.0
"""Weight of a focal loss of classes."""
_BOX = 0.25
_NUMBERS = 7
_ALPHA, _GAMMA = 0.25, 2.0
"""The focal loss's weight of positives, and the power of its factor (Lin et al. 2017)."""
_NEAR_M = 20.0
_LIGHT_WITHIN_M = 60.0
_LIGHT, _LIGHT_M, _LEAD_M, _WALKER_M, _OBSTACLE_M = map(
    FACTS.index, ("light", "light_m", "lead_m", "walker_m", "obstacle_m")
)
"""Columns of `facts`."""


def _focal(logits: Tensor, targets: Tensor) -> Tensor:
    """Return the focal loss of 0/1 targets, summed."""
    entropy = functional.binary_cross_entropy_with_logits(logits, targets, reduction="none")
    p = logits.sigmoid()
    wrong = targets + p - 2.0 * targets * p
    weight = (_ALPHA * targets + (1.0 - _ALPHA) * (1.0 - targets)) * wrong**_GAMMA
    return (weight * entropy).sum()


def focal_cost(logits: Tensor, classes: Tensor) -> Tensor:
    """Return the cost of a query (N, Q, C) being of a class (N, T): (N, Q, T)."""
    p = logits.sigmoid()
    here = -_ALPHA * (1.0 - p) ** _GAMMA * functional.logsigmoid(logits)
    not_here = -(1.0 - _ALPHA) * p**_GAMMA * functional.logsigmoid(-logits)
    return (here - not_here).gather(2, classes[:, None].expand(-1, logits.shape[1], -1))


def class_loss(logits: Tensor, classes: Tensor, found: Match) -> Tensor:
    """Return the focal loss per match of logits (N, Q, C), where matched queries have the classes (N, T) of targets."""
    wanted = torch.zeros_like(logits)
    wanted[found.rows, found.queries, classes[found.rows, found.targets]] = 1.0
    return _focal(logits, wanted) / max(len(found.rows), 1)


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
            found = match(FOCAL * focal_cost(told, classes) + _BOX * off.abs().sum(-1), valid)
        kind_loss = kind_loss + class_loss(told, classes, found)
        off = shape[found.rows, found.queries, :_NUMBERS] - labels[found.rows, found.targets]
        box_loss = box_loss + (off * weight).abs().sum() / max(len(found.rows), 1)
    return FOCAL * kind_loss / len(logits), _BOX * box_loss / len(logits), found


def hint_loss(hints: Tensor, facts: Tensor) -> Tensor:
    """Compute the loss of the ego query's hints, the light ahead and the nearness of things; not a published loss.

    `facts` (N, 16) as `training.data.facts.FACTS`.
    """
    light = facts[:, _LIGHT]
    shown = torch.where(facts[:, _LIGHT_M] < _LIGHT_WITHIN_M, light, torch.full_like(light, -1.0)).long() + 1
    blocked = torch.minimum(facts[:, _WALKER_M], facts[:, _OBSTACLE_M])
    near = torch.exp(-torch.stack((facts[:, _LIGHT_M], facts[:, _LEAD_M], blocked), dim=1).clamp(min=0.0) / _NEAR_M)
    return functional.cross_entropy(hints[:, :5], shown) + 4.0 * (hints[:, 5:] - near).abs().mean()
