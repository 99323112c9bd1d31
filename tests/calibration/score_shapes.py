"""Scores of extreme shapes, at a known degradation: what a planner with rare failures or a broken agent looks like."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from score_model import Scores

Shape = Callable[[float, int, int, int], tuple[Scores, Scores]]


def bimodal(rd: float, studies: int, routes: int, seed: int) -> tuple[Scores, Scores]:
    """All or nothing, 80 % of the clean runs succeed, and success under the perturbation has nothing to do with it."""
    rng = np.random.default_rng(seed)
    shape = (studies, routes)
    return 100.0 * (rng.random(shape) < 0.8), 100.0 * (rng.random(shape) < 0.8 * (1.0 - rd))


def rare_failures(rd: float, studies: int, routes: int, seed: int) -> tuple[Scores, Scores]:
    """Perfect, but for one route in 1 / rd that is lost altogether."""
    rng = np.random.default_rng(seed)
    shape = (studies, routes)
    return np.full(shape, 100.0), 100.0 * (rng.random(shape) >= rd)


def even_loss(spread: float) -> Shape:
    """Nearly every route loses about the same; 1.2 of all that are drawn, on average, fail clean and succeed then.

    Those make up for the others, and in three samples of ten there is none of them.
    """

    def draw(rd: float, studies: int, routes: int, seed: int) -> tuple[Scores, Scores]:
        rng = np.random.default_rng(seed)
        shape, share = (studies, routes), 1.2 / routes
        makes_up = rng.random(shape) < share
        usual = 100.0 * (1.0 - rd - share / (1.0 - share))
        perturbed = np.where(makes_up, 100.0, usual + spread * rng.uniform(-1.0, 1.0, shape))
        return np.where(makes_up, 0.0, 100.0), perturbed

    return draw


def constant(rd: float, studies: int, routes: int, seed: int) -> tuple[Scores, Scores]:
    """No spread at all; the level differs from study to study."""
    level = np.random.default_rng(seed).uniform(5.0, 100.0, (studies, 1))
    clean = np.broadcast_to(level, (studies, routes))
    return clean, clean * (1.0 - rd)


def proportional(rd: float, studies: int, routes: int, seed: int) -> tuple[Scores, Scores]:
    """Every route loses the same share: spread in the scores, none in the difference."""
    clean = np.random.default_rng(seed).uniform(5.0, 100.0, (studies, routes))
    return clean, clean * (1.0 - rd)


def fixed_clean(rd: float, studies: int, routes: int, seed: int) -> tuple[Scores, Scores]:
    """Always the same clean score, anything from 0 to twice the mean under the perturbation."""
    shape = (studies, routes)
    return np.full(shape, 60.0), np.random.default_rng(seed).uniform(0.0, 120.0 * (1.0 - rd), shape).clip(0.0, 100.0)


SHAPES: dict[str, tuple[Shape, float, float]] = {
    "bimodal": (bimodal, 0.30, 0.10),
    "rare failures": (rare_failures, 0.02, 0.05),
    "less rare failures": (rare_failures, 0.05, 0.05),
    "rare successes": (rare_failures, 0.90, 0.05),
    "even loss": (even_loss(3.0), 0.30, 0.10),
    "uneven loss": (even_loss(20.0), 0.30, 0.10),
    "constant": (constant, 0.30, 0.10),
    "proportional": (proportional, 0.30, 0.10),
    "fixed clean": (fixed_clean, 0.30, 0.10),
}
"""Name to shape, threshold and margin."""

WITHOUT_SPREAD = ("constant", "proportional")
"""What every study shows alike, so that a few show it."""
