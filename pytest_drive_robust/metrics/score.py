"""Driving score and success of one episode, as Bench2Drive counts them.

Sources: Bench2Drive `leaderboard/leaderboard/utils/statistics_manager.py` (penalties) and
`tools/merge_route_json.py` (success rule).
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from pytest_drive_robust.domain.outcome import End, Infraction, InfractionKind, Outcome
from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.metrics.episodes import require_scorable

PENALTIES: Mapping[InfractionKind, float] = MappingProxyType(
    {
        InfractionKind.COLLISION_PEDESTRIAN: 0.5,
        InfractionKind.COLLISION_VEHICLE: 0.6,
        InfractionKind.COLLISION_LAYOUT: 0.65,
        InfractionKind.RED_LIGHT: 0.7,
        InfractionKind.STOP_SIGN: 0.8,
        InfractionKind.SCENARIO_TIMEOUT: 0.7,
        InfractionKind.YIELD_EMERGENCY: 0.7,
    }
)
"""The penalty factor of each infraction kind. `OUTSIDE_LANES` has a factor by its share; other kinds have none."""


def penalty(result: EpisodeResult) -> float:
    """Return the product of the factors of all infractions, 0..1: P in `DS = RC * P`."""
    product = 1.0
    for infraction in result.infractions:
        product *= _factor(infraction)
    return product


def driving_score(result: EpisodeResult) -> float:
    """Return route completion times penalty, 0..100, rounded to 6 digits like the official records.

    An episode that ended with `agent_error` is scored for the part driven until then. Raises `ComparisonError` for an
    `infra_error`.
    """
    require_scorable([result])
    return round(max(result.route_completion_pct * penalty(result), 0.0), 6)


def is_success(result: EpisodeResult) -> bool:
    """Return True when the route was completed and every infraction list but the minimum-speed one is empty.

    Raises `ComparisonError` for an `infra_error`.
    """
    require_scorable([result])
    return (
        result.outcome is Outcome.COMPLETED
        and result.end is End.COMPLETED
        and all(infraction.kind is InfractionKind.MIN_SPEED for infraction in result.infractions)
    )


def _factor(infraction: Infraction) -> float:
    if infraction.kind is InfractionKind.OUTSIDE_LANES:
        return 1.0 - infraction.share_pct / 100.0
    return PENALTIES.get(infraction.kind, 1.0)
