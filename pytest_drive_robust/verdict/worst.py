"""The routes that explain a verdict best: where the agent lost most."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.metrics.score import driving_score
from pytest_drive_robust.verdict.describe import describe_outcome
from pytest_drive_robust.verdict.divergence import first_divergence

__all__ = ["WorstRoute", "worst_routes"]

_NOT_DRIVEN = "not driven"


@dataclass(frozen=True, slots=True)
class WorstRoute:
    """One episode under the setting beside its clean twin. Scores are driving scores, 0..100.

    `clean_score` is None and `clean_outcome` `"not driven"` when there is no clean twin; `diverged_s` is the second at
    which the two began to differ, None when they never did or there is no twin; `diverged_by` says in what.
    """

    route_id: str
    scenario: str
    seed: int
    clean_score: float | None
    perturbed_score: float
    clean_outcome: str
    perturbed_outcome: str
    diverged_s: float | None
    diverged_by: str = ""


def worst_routes(
    clean: Sequence[EpisodeResult], perturbed: Sequence[EpisodeResult], *, relative: bool, count: int = 3
) -> tuple[WorstRoute, ...]:
    """At most `count` routes, one episode each, the worst first.

    `relative`: by the driving score that was lost against the clean twin, routes that lost nothing left out (every
    perturbed episode must have its twin). Otherwise by the lowest driving score, full scores left out. Ties go by
    route and seed, so that the order is always the same.
    """
    twins = {(result.episode.route_id, result.episode.seed): result for result in clean}
    ranked: list[tuple[float, str, int, EpisodeResult]] = []
    for result in perturbed:
        route_id, seed = result.episode.route_id, result.episode.seed
        reference = driving_score(twins[route_id, seed]) if relative else 100.0
        loss = reference - driving_score(result)
        if loss > 0.0:
            ranked.append((-loss, route_id, seed, result))
    worst: dict[str, EpisodeResult] = {}
    for _, route_id, _, result in sorted(ranked, key=lambda entry: entry[:3]):
        worst.setdefault(route_id, result)
    chosen = list(worst.values())[:count]
    return tuple(_explain(result, twins.get((result.episode.route_id, result.episode.seed))) for result in chosen)


def _explain(result: EpisodeResult, twin: EpisodeResult | None) -> WorstRoute:
    parted = None if twin is None else first_divergence(twin, result)
    return WorstRoute(
        route_id=result.episode.route_id,
        scenario=result.scenario,
        seed=result.episode.seed,
        clean_score=None if twin is None else driving_score(twin),
        perturbed_score=driving_score(result),
        clean_outcome=_NOT_DRIVEN if twin is None else describe_outcome(twin),
        perturbed_outcome=describe_outcome(result),
        diverged_s=None if parted is None else parted.second,
        diverged_by="" if parted is None else parted.signal,
    )
