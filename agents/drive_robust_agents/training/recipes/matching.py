"""Match queries to labels: the assignment of least cost in each row of a batch (Kuhn 1955; DETR)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import torch
from scipy.optimize import linear_sum_assignment
from torch import Tensor

__all__ = ["Match", "match"]


class Match(NamedTuple):
    """Pairs: `rows`, `queries` and `targets` (n,) int64 each, in the order of rows."""

    rows: Tensor
    queries: Tensor
    targets: Tensor


def match(cost: Tensor, valid: Tensor) -> Match:
    """Return the pairs of least total cost: `cost` (N, Q, T), `valid` (N, T) marks existing targets.

    Each valid target gets one query while queries last. A NaN cost counts as a very high cost.
    """
    costs = cost.detach().float().nan_to_num(nan=1e6, posinf=1e6, neginf=-1e6).cpu().numpy()
    there = valid.cpu().numpy()
    pairs = []
    for row in range(len(costs)):
        targets = np.flatnonzero(there[row])
        queries, picked = linear_sum_assignment(costs[row][:, targets])
        pairs.append(np.stack([np.full_like(queries, row), queries, targets[picked]]))
    found = torch.from_numpy(np.concatenate(pairs, axis=1) if pairs else np.zeros((3, 0), np.int64)).to(cost.device)
    return Match(*found.long())
