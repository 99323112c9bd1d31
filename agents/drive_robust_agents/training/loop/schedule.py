"""The schedule of a training: its stages and its learning rate."""

from __future__ import annotations

import math
from collections.abc import Sequence

from drive_robust_agents.training.recipes.recipe import TrainingStage

__all__ = ["cycle", "learning_rate", "stage_at"]

_WARM_UP, _FIRST, _LAST = 0.1, 1.0 / 25.0, 1e-3


def cycle(progress: float) -> float:
    """Return the rate at 0 to 1 of a stage: a cosine up from 1/25 in the first tenth, then down to 1/1000."""
    if progress < _WARM_UP:
        return _FIRST + (1.0 - _FIRST) * 0.5 * (1.0 - math.cos(math.pi * progress / _WARM_UP))
    return _LAST + (1.0 - _LAST) * 0.5 * (1.0 + math.cos(math.pi * (progress - _WARM_UP) / (1.0 - _WARM_UP)))


def stage_at(stages: Sequence[TrainingStage], step: int, total: int) -> tuple[int, float]:
    """Return (number of the stage, progress 0 to 1 within the stage) of a step, 0 to `total - 1`."""
    shares = [stage.share for stage in stages]
    done = 0.0
    for number, share in enumerate(shares):
        begin, end = round(done * total / sum(shares)), round((done + share) * total / sum(shares))
        if step < end or number == len(shares) - 1:
            return number, min((step - begin) / max(end - begin, 1), 1.0)
        done += share
    raise ValueError("a training has at least one stage")


def learning_rate(stages: Sequence[TrainingStage], step: int, total: int, peak: float) -> float:
    """Return the learning rate of a step."""
    _, progress = stage_at(stages, step, total)
    return peak * cycle(progress)
