"""The losses of VAD's paths of agents and of its map vectors, each matched to labels at least cost.

Shapes as in the samples: boxes (N, B, 9), futures (N, B, T, 2), lanes (N, V, P, 2), kinds (N, V); metres, ego frame.
Weights are the published ones (focal 2, 0.2 on paths), per positive, as a mean over the layers; points of lines count
0.1 a metre (published: 1, of points divided by the range of the map).
"""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor
from torch.nn import functional

from drive_robust_agents.training.recipes.bev_losses import FOCAL, class_loss, focal_cost
from drive_robust_agents.training.recipes.matching import Match, match

__all__ = ["lane_loss", "path_loss"]

_LINE, _TURN, _PATH = 0.1, 0.005, 0.2


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
            found = match(FOCAL * focal_cost(told, classes) + _LINE * least, valid)
        kind_loss = kind_loss + class_loss(told, classes, found)
        mine = line[found.rows, found.queries]
        label = both[found.rows, found.targets, order[found.rows, found.queries, found.targets]]
        turn = 1.0 - functional.cosine_similarity(mine.diff(dim=1), label.diff(dim=1), dim=-1)
        off_m = (mine - label).abs().sum(-1).mean(-1)
        point_loss = point_loss + (_LINE * off_m + _TURN * turn.mean(-1)).sum() / max(len(found.rows), 1)
    return FOCAL * kind_loss / len(logits), point_loss / len(logits)
