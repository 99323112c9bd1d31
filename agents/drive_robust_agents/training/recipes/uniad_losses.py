"""The losses of UniAD's heads that VAD does not share; weights are as published unless stated otherwise.

Shapes as in the samples: boxes (N, B, 9), futures (N, B, T, 2), lanes (N, V, P, 2), kinds (N, V); metres, ego frame.
"""

from __future__ import annotations

import torch
from torch import Tensor
from torch.nn import functional

from drive_robust_agents.training.recipes.bev_losses import FOCAL, class_loss, focal_cost
from drive_robust_agents.training.recipes.matching import Match, match

__all__ = [
    "collision_loss",
    "heat_loss",
    "mask_loss",
    "motion_loss",
    "occupancy_loss",
    "painted",
    "pairs_table",
]

_EGO_M = (4.9, 2.0)
_WIDER = ((0.0, 2.5), (0.5, 1.0), (1.0, 0.25))
"""(metres around the ego, weight): UniAD's three collision losses."""
_FAR_M, _AREA_M2 = 1.0e3, 4.0
_LOG_SPREAD = (-1.5, 3.0)


def heat_loss(logits: Tensor, heat: Tensor) -> Tensor:
    """Compute CenterNet's focal loss (Zhou et al. 2019) of (N, cells), per object; beside a centre it is smaller."""
    p = logits.sigmoid()
    centre = heat == 1.0
    hit = -functional.logsigmoid(logits) * (1.0 - p) ** 2
    miss = -functional.logsigmoid(-logits) * p**2 * (1.0 - heat) ** 4
    return torch.where(centre, hit, miss).sum() / centre.sum().clamp(min=1)


def painted(logits: Tensor, truth: Tensor) -> Tensor:
    """Compute binary cross-entropy (a filled cell counts four times) plus dice of (n, cells), each a mean over n."""
    weight = truth.new_tensor(4.0)
    entropy = functional.binary_cross_entropy_with_logits(logits, truth, pos_weight=weight)
    p = logits.sigmoid()
    dice = 1.0 - 2.0 * ((p * truth).sum(-1) + 0.5) / (p.sum(-1) + truth.sum(-1) + 1.0)
    return entropy + dice.mean() if len(logits) else logits.sum() * 0.0


def mask_loss(logits: Tensor, masks: Tensor, truth: Tensor, kind: Tensor) -> tuple[Tensor, Tensor]:
    """Return (class loss, mask loss) of lanes.

    Takes logits (N, Q, 6), masks (N, Q, cells), truth (N, V, cells) and kind (N, V).
    """
    valid, classes = (kind >= 0) & (truth.sum(-1) > 0.0), kind.clamp(min=0).long()
    with torch.no_grad():
        p = masks.sigmoid()
        dice = 1.0 - 2.0 * (p @ truth.transpose(1, 2)) / (p.sum(-1)[..., None] + truth.sum(-1)[:, None] + 1.0)
        found = match(focal_cost(logits, classes) + 2.0 * dice, valid)
    painting = painted(masks[found.rows, found.queries], truth[found.rows, found.targets])
    return FOCAL * class_loss(logits, classes, found), painting


def motion_loss(paths: Tensor, spread: Tensor, logits: Tensor, way: Tensor) -> Tensor:
    """Compute the loss of modes (n, M, T, 2) against ways (n, T, 2; NaN: unknown), metres, own frame.

    Only the mode nearest to the way learns the way, and learns to be likely. The loss is the negative log-likelihood of
    a two-dimensional normal distribution; `spread` (n, M, T, 3) as in `Motions`.
    """
    there = ~way.isnan().any(-1)
    off = paths - way.nan_to_num(0.0)[:, None]
    away = (off.square().sum(-1) + 1e-6).sqrt() * there[:, None]
    best = away.detach().sum(-1).argmin(1)
    rows = torch.arange(len(way), device=way.device)
    scale = spread[rows, best, :, :2].clamp(*_LOG_SPREAD)
    rho = 0.9 * torch.tanh(spread[rows, best, :, 2])
    unit = off[rows, best] * torch.exp(-scale)
    square = unit.square().sum(-1) - 2.0 * rho * unit.prod(-1)
    free = 1.0 - rho.square()
    nll = (0.5 * square / free + scale.sum(-1) + 0.5 * free.log()).clamp(max=20.0) * there
    steps = there.sum().clamp(min=1)
    seen = there.any(-1)
    choice = functional.cross_entropy(logits, best, reduction="none") * seen
    return 0.2 * (nll.sum() + away[rows, best].sum()) / steps + 0.2 * choice.sum() / seen.sum().clamp(min=1)


def occupancy_loss(whose: Tensor, anyone: Tensor, truth: Tensor, known: Tensor) -> Tensor:
    """Compute the loss of agents' cells where `known` (N, K), and of anyone's, against truth.

    Shapes are (N, K, T, cells) for agents and truth, (N, T, cells) for anyone.
    """
    together = painted(anyone.flatten(0, 1), truth.amax(1).flatten(0, 1))
    return together + painted(whose[known].flatten(0, 1), truth[known].flatten(0, 1))


def collision_loss(plan: Tensor, true_pose: Tensor, boxes: Tensor, futures: Tensor) -> Tensor:
    """Return UniAD's collision losses, a scalar: the overlap of the widened ego with others on a plan (N, T, 2).

    `true_pose` (N, T, 3: x, y, yaw) is the expert's pose: its yaw turns the ego's box, and places where the expert
    comes as near do not count.
    """
    there = ~futures.isnan().any(-1) & (boxes[..., 8] > 0.5)[..., None]
    cos, sin = torch.cos(true_pose[..., 2])[:, None], torch.sin(true_pose[..., 2])[:, None]
    c = (cos * boxes[..., 3, None] + sin * boxes[..., 2, None]).abs()
    s = (cos * boxes[..., 2, None] - sin * boxes[..., 3, None]).abs()
    length, width = boxes[..., 4, None], boxes[..., 5, None]
    reach = 0.5 * torch.stack((c * length + s * width + _EGO_M[0], s * length + c * width + _EGO_M[1]), dim=-1)
    away = _away(plan, futures, cos, sin)
    expert = _away(true_pose[..., :2], futures, cos, sin)
    total = plan.new_zeros(())
    for wider, weight in _WIDER:
        free = ((reach + wider - expert).amin(-1) <= 0.0) & there
        area = (reach + wider - away).clamp(min=0.0).prod(-1)
        total = total + weight * (torch.where(free, area, torch.zeros_like(area)) / _AREA_M2).sum(1).mean()
    return total


def _away(points: Tensor, futures: Tensor, cos: Tensor, sin: Tensor) -> Tensor:
    """Return distances (N, B, T, 2) along and across the ego between points (N, T, 2) and others (N, B, T, 2)."""
    dx, dy = (futures.nan_to_num(_FAR_M) - points[:, None]).unbind(-1)
    return torch.stack((cos * dx + sin * dy, cos * dy - sin * dx), dim=-1).abs()


def pairs_table(found: Match, rows: int, targets: int) -> tuple[Tensor, Tensor]:
    """Return (queries, matched), both (N, K): the query of each of the first `targets` labels, whether there is one."""
    queries = torch.zeros(rows, targets, dtype=torch.int64, device=found.rows.device)
    known = torch.zeros(rows, targets, dtype=torch.bool, device=found.rows.device)
    near = found.targets < targets
    queries[found.rows[near], found.targets[near]] = found.queries[near]
    known[found.rows[near], found.targets[near]] = True
    return queries, known
