"""Robustness degradation (RD), the metric of the paper (section "Metrics"), and the pairing of its episodes."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Sequence

from pytest_drive_robust.arithmetic.signals import mean
from pytest_drive_robust.domain.result import MACHINE_FACTS, EpisodeResult
from pytest_drive_robust.errors import ComparisonError, first_few
from pytest_drive_robust.metrics.episodes import require_scorable, route_and_seed, values_by_route
from pytest_drive_robust.metrics.score import driving_score

EpisodePair = tuple[EpisodeResult, EpisodeResult]
"""The clean and the perturbed episode of one (route, seed)."""

_SHOWN = 5


def robustness_degradation(clean: Sequence[EpisodeResult], perturbed: Sequence[EpisodeResult]) -> float:
    """Return RD = 1 - DS_perturbed / DS_clean of the mean driving scores over equal routes and seeds; 1 at most.

    An RD of 0 is no loss. Raises `ComparisonError` for sets that do not pair (see `pair_up`) and for a clean driving
    score of 0: an agent that drives nowhere has nothing to lose.
    """
    clean_scores, perturbed_scores = paired_driving_scores(clean, perturbed)
    return 1.0 - mean(perturbed_scores) / mean(clean_scores)


def paired_driving_scores(
    clean: Sequence[EpisodeResult], perturbed: Sequence[EpisodeResult]
) -> tuple[list[float], list[float]]:
    """Return the clean and the perturbed driving score of each route (mean over its seeds), in the same order.

    Raises `ComparisonError` as `robustness_degradation` does.
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


def pair_up(clean: Sequence[EpisodeResult], perturbed: Sequence[EpisodeResult]) -> tuple[EpisodePair, ...]:
    """Pair by (route, seed), in the order of `clean`.

    Raises `ComparisonError` when a set is empty, holds an `infra_error` or one pair twice, when the sets differ in
    their (route, seed) pairs, when agents or simulator versions differ, or when a set mixes settings.
    """
    for name, results in (("clean", clean), ("perturbed", perturbed)):
        if not results:
            raise ComparisonError(f"the {name} set holds no episode. Expected the same routes and seeds in both sets.")
        require_scorable(results)
        settings = sorted({result.episode.setting for result in results})
        if len(settings) > 1:
            raise ComparisonError(f"the {name} set mixes settings: {'; '.join(settings)}. Expected one.")
        repeated = [key for key, count in Counter(map(route_and_seed, results)).items() if count > 1]
        if repeated:
            raise ComparisonError(
                f"the {name} set holds more than one episode of {_listed(repeated)}. Expected each (route, seed) once."
            )
    _require_same_pairs(clean, perturbed)
    _require_same_world([*clean, *perturbed])
    twins = {route_and_seed(result): result for result in perturbed}
    return tuple((result, twins[route_and_seed(result)]) for result in clean)


def _listed(keys: Collection[tuple[str, int]]) -> str:
    return first_few([f"(route {route}, seed {seed})" for route, seed in sorted(keys)], _SHOWN)


def _require_same_pairs(clean: Sequence[EpisodeResult], perturbed: Sequence[EpisodeResult]) -> None:
    clean_keys, perturbed_keys = set(map(route_and_seed, clean)), set(map(route_and_seed, perturbed))
    if clean_keys == perturbed_keys:
        return
    parts = [
        f"only {name}: {_listed(keys)}"
        for name, keys in (("clean", clean_keys - perturbed_keys), ("perturbed", perturbed_keys - clean_keys))
        if keys
    ]
    raise ComparisonError(
        f"the clean and the perturbed set differ in their (route, seed) pairs: {'; '.join(parts)}. "
        "Drive the missing episodes, or compare the common pairs only."
    )


def _require_same_world(results: Sequence[EpisodeResult]) -> None:
    agents = sorted({result.episode.agent for result in results})
    if len(agents) > 1:
        raise ComparisonError(f"the episodes are of different agents: {', '.join(agents)}. Expected one.")
    reference = _versions_of(results[0])
    for result in results[1:]:
        versions = _versions_of(result)
        if versions != reference:
            different = sorted(name for name in {*reference, *versions} if reference.get(name) != versions.get(name))
            changes = ", ".join(
                f"{name} {reference.get(name, 'absent')} and {versions.get(name, 'absent')}" for name in different
            )
            raise ComparisonError(
                f"the episodes were driven with different versions of the simulator or of libraries: {changes} "
                f"(first: {result.episode}). Drive both sets with the same one."
            )


def _versions_of(result: EpisodeResult) -> dict[str, str]:
    """Return the versions that must be equal. Facts of the machine may change rounding; the reports show them."""
    return {name: version for name, version in result.versions.items() if name not in MACHINE_FACTS}
