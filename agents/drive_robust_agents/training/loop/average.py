"""The exponential mean of the trained network, whose weights ship."""

from __future__ import annotations

import copy

import torch
from torch import Tensor, nn

__all__ = ["Average"]

_DECAY = 0.999


class Average:
    """The mean network `net`, over about the last thousand steps (fewer at first), of parameters and statistics."""

    def __init__(self, net: nn.Module) -> None:
        self.net = copy.deepcopy(net).requires_grad_(False).eval()
        own, others = self.net.state_dict(), net.state_dict()
        moving = [name for name, value in own.items() if value.is_floating_point()]
        self._own: list[Tensor] = [own[name] for name in moving]
        self._others: list[Tensor] = [others[name] for name in moving]

    def follow(self, step: int) -> None:
        """Move the mean towards the trained network after its step number `step`, 0 and up."""
        decay = min(_DECAY, (1.0 + step) / (10.0 + step))
        with torch.no_grad():
            torch._foreach_lerp_(self._own, self._others, 1.0 - decay)
