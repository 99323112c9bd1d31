"""Robustness degradation, the paper's own metric (section "Metrics")."""

from __future__ import annotations

from collections.abc import Sequence

from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.errors import ComparisonError
from pytest_drive_robust.metrics.averages import mean, values_by_route
from pytest_drive_robust.metrics.pairing import pair_up
from pytest_drive_robust.metrics.score import driving_score

__all__ = ["paired_driving_scores", "robustness_degradation"]


def robustness_degradation(clean: Sequence[EpisodeResult], perturbed: Sequence[EpisodeResult]) -> float:
    """RD = 1 - DS_perturbed / DS_clean, on means over the same routes and seeds; at most 1, 0 is no degradation.

    Raises `ComparisonError` for sets that do not pair (see `pairing.pair_up`) and for a clean driving score of 0:
    an agent that drives nowhere has nothing to lose.
    """
    clean_scores, perturbed_scores = paired_driving_scores(clean, perturbed)
    return 1.0 - mean(perturbed_scores) / mean(clean_scores)


def paired_driving_scores(
    clean: Sequence[EpisodeResult], perturbed: Sequence[EpisodeResult]
) -> tuple[list[float], list[float]]:
    """The clean and the perturbed driving score of each route (mean over its seeds), in the same order.

    Refuses the same sets as `robustness_degradation`.
    """
    pairs = pair_up(clean, perturbed)
    clean_scores = list(values_by_route([pair[0] for pair in pairs], driving_score).values())
    perturbed_scores = list(values_by_route([pair[1] for pair in pairs], driving_score).values())
    if mean(clean_scores) <= 0.0:
        raise ComparisonError(
            f"the clean driving score of agent {clean[0].episode.agent!r} is 0 on all {len(clean_scores)} routes, so "
            "its degradation is undefined. Check the agent, or ask for a clean floor first: 'DS under clean >= 30'."
        )
    return clean_scores, perturbed_scores
