"""Which clean episode belongs to which perturbed one; refuses sets that must not be compared."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from pytest_drive_robust.domain.result import MACHINE_FACTS, EpisodeResult
from pytest_drive_robust.errors import ComparisonError
from pytest_drive_robust.metrics.guards import require_scorable

__all__ = ["EpisodePair", "pair_up"]

EpisodePair = tuple[EpisodeResult, EpisodeResult]
"""The clean and the perturbed episode of one (route, seed)."""

_Key = tuple[str, int]
_SHOWN = 5


def pair_up(clean: Sequence[EpisodeResult], perturbed: Sequence[EpisodeResult]) -> tuple[EpisodePair, ...]:
    """Pair by (route, seed), in the order of `clean`.

    Raises `ComparisonError` when a set is empty, holds an `infra_error` or one pair twice, when the sets differ in
    their (route, seed) pairs, when agents or simulator versions differ, or when a set mixes settings.
    """
    for name, results in (("clean", clean), ("perturbed", perturbed)):
        if not results:
            raise ComparisonError(f"the {name} set holds no episode. Expected the same routes and seeds in both sets.")
        require_scorable(results)
        _require_one_setting(name, results)
        _require_no_duplicate(name, results)
    _require_same_pairs(clean, perturbed)
    _require_same_world([*clean, *perturbed])
    twins = {_key(result): result for result in perturbed}
    return tuple((result, twins[_key(result)]) for result in clean)


def _key(result: EpisodeResult) -> _Key:
    return result.episode.route_id, result.episode.seed


def _listed(keys: Sequence[_Key]) -> str:
    shown = ", ".join(f"(route {route}, seed {seed})" for route, seed in sorted(keys)[:_SHOWN])
    more = len(keys) - _SHOWN
    return f"{shown} and {more} more" if more > 0 else shown


def _require_no_duplicate(name: str, results: Sequence[EpisodeResult]) -> None:
    repeated = [key for key, count in Counter(map(_key, results)).items() if count > 1]
    if repeated:
        raise ComparisonError(
            f"the {name} set holds more than one episode of {_listed(repeated)}. Expected each (route, seed) once."
        )


def _require_same_pairs(clean: Sequence[EpisodeResult], perturbed: Sequence[EpisodeResult]) -> None:
    clean_keys, perturbed_keys = set(map(_key, clean)), set(map(_key, perturbed))
    if clean_keys == perturbed_keys:
        return
    parts = [
        f"only {name}: {_listed(sorted(keys))}"
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
                f"the episodes were driven with different versions of the simulator: {changes} "
                f"(first: {result.episode}). Drive both sets with the same one."
            )


def _versions_of(result: EpisodeResult) -> dict[str, str]:
    """Another machine may round differently, which the reports say; it is the same world."""
    return {name: version for name, version in result.versions.items() if name not in MACHINE_FACTS}


def _require_one_setting(name: str, results: Sequence[EpisodeResult]) -> None:
    settings = sorted({result.episode.setting for result in results})
    if len(settings) > 1:
        raise ComparisonError(f"the {name} set mixes settings: {'; '.join(settings)}. Expected one.")
