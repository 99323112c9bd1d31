"""VAD's constraints on a plan (Jiang et al. 2023, section 3.4): off bodies, inside the road, along the lane.

Each loss is 0 for a plan within the constraint and grows with the violation. The constraints use the labels; the
published ones use the model's own predictions above a threshold, which stay too poor for long in a compact model.
Shapes: plans (N, T, 2) at 0.5, 1.0 ... s, boxes (N, B, 9), futures (N, B, T, 2), lanes (N, V, P, 2), kinds (N, V), all
as in the samples: metres, ego frame (x forward, y right), NaN for none.
"""

from __future__ import annotations

import torch
from torch import Tensor

from drive_robust_agents.training.data.perception import ROUTE, SOLID

__all__ = ["boundary_loss", "collision_loss", "direction_loss"]

_AHEAD_M, _ASIDE_M = 3.0, 1.5
_EDGE_M = 1.0
_ON_LANE_M, _MOVES_M = 2.0, 0.5
_FAR_M = 1.0e3


def collision_loss(plans: Tensor, boxes: Tensor, futures: Tensor) -> Tensor:
    """Return (N,) by how much bodies come nearer than 3 m along and 1.5 m aside to a waypoint at its time."""
    there = ~futures.isnan().any(-1) & (boxes[..., 8] > 0.5)[..., None]
    away = (plans[:, None] - futures.nan_to_num(_FAR_M)).abs()
    close = there & (away[..., 0] < _AHEAD_M) & (away[..., 1] < _ASIDE_M)
    missing = (_AHEAD_M - away[..., 0]) + (_ASIDE_M - away[..., 1])
    worst = torch.where(close, missing, torch.zeros_like(missing)).amax(1)
    return worst.mean(1)


def boundary_loss(plans: Tensor, lanes: Tensor, lane_kind: Tensor) -> Tensor:
    """Return by how much waypoints come nearer than 1 m to the edge of the road; (N,)."""
    off, _ = _nearest(plans, lanes, lane_kind == SOLID)
    return (_EDGE_M - off).clamp(min=0.0).mean(1)


def direction_loss(plans: Tensor, lanes: Tensor, lane_kind: Tensor) -> Tensor:
    """Return (N,) the angle [rad] between moving steps and the route's lane, within 2 m of the lane."""
    start = torch.cat([torch.zeros_like(plans[:, :1]), plans[:, :-1]], dim=1)
    step = plans - start
    off, along = _nearest(plans, lanes, lane_kind == ROUTE)
    counts = (step.detach().norm(dim=-1) > _MOVES_M) & (off.detach() < _ON_LANE_M)
    safe = torch.where(counts[..., None], step, along)
    cross = along[..., 0] * safe[..., 1] - along[..., 1] * safe[..., 0]
    angle = torch.atan2(cross, (along * safe).sum(-1)).abs()
    return torch.where(counts, angle, torch.zeros_like(angle)).mean(1)


def _nearest(plans: Tensor, lanes: Tensor, wanted: Tensor) -> tuple[Tensor, Tensor]:
    """Return the distance (N, T) [m] to the nearest piece of the wanted lines and its direction (N, T, 2).

    The distance is large without such a line.
    """
    start, piece = lanes[:, :, :-1].flatten(1, 2), lanes.diff(dim=2).flatten(1, 2)
    good = wanted[..., None].expand(-1, -1, lanes.shape[2] - 1).flatten(1)
    good = (good & ~(start + piece).isnan().any(-1))[:, None]
    start, piece = start.nan_to_num(_FAR_M)[:, None], piece.nan_to_num(1.0)[:, None]
    away = plans[:, :, None] - start
    share = ((away * piece).sum(-1) / piece.square().sum(-1).clamp(min=1e-6)).clamp(0.0, 1.0)
    off = (away - share[..., None] * piece).square().sum(-1).clamp(min=1e-8).sqrt()
    off = torch.where(good, off, torch.full_like(off, _FAR_M))
    nearest, which = off.min(dim=2)
    direction = piece.expand(-1, plans.shape[1], -1, -1).gather(2, which[..., None, None].expand(-1, -1, 1, 2))[:, :, 0]
    return nearest, torch.nn.functional.normalize(direction, dim=-1)
