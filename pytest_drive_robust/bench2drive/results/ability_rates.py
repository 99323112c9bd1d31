"""The five abilities of a set of records.

Traffic_Signs has a rule of its own: a failed route counts there when the car came 8 waypoints beyond the first
junction without running a red light or a stop sign. Where the first junction is only the map of the town tells, so
without our own mark in the record the rate of Traffic_Signs is known to lie between two numbers.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from pytest_drive_robust.bench2drive.results.official_record import OfficialRecord
from pytest_drive_robust.metrics.ability import ABILITIES
from pytest_drive_robust.metrics.averages import mean

__all__ = ["AbilityRate", "ability_rates", "mean_rate", "undecided_routes"]

_SIGNS = "Traffic_Signs"


@dataclass(frozen=True, slots=True)
class AbilityRate:
    """Between `low` and `high` (0..1), both None where there is no route; `routes` it is the rate of."""

    low: float | None
    high: float | None
    routes: int

    @property
    def value(self) -> float | None:
        """The rate where it is known exactly."""
        return self.low if self.low == self.high else None


def ability_rates(
    records: Iterable[OfficialRecord],
    scenarios: Mapping[str, str] | None,
    *,
    official: bool,
    junctions: Mapping[str, float] | None = None,
) -> dict[str, AbilityRate]:
    """Count the successes of each ability.

    `scenarios`: only these routes, of these types. `official`: of a route the first record counts.

    `junctions`: the share of each route after which its first junction is passed, where it is known.
    """
    by_route: dict[str, list[OfficialRecord]] = {}
    for record in records:
        # The official tool cuts at every underscore.
        found = by_route.setdefault(record.route.partition("_")[0] if official else record.route, [])
        if not (official and found):
            found.append(record)
    kept = {route: found for route, found in by_route.items() if scenarios is None or route in scenarios}
    types = {route: found[0].scenario if scenarios is None else scenarios[route] for route, found in kept.items()}
    known = junctions or {}
    return {
        ability: _rate([found for route, found in kept.items() if types[route] in members], ability == _SIGNS, known)
        for ability, members in ABILITIES.items()
    }


def undecided_routes(records: Iterable[OfficialRecord], scenarios: Mapping[str, str]) -> frozenset[str]:
    """Return the routes of Traffic_Signs whose part in it only a map can tell."""
    return frozenset(
        record.route
        for record in records
        if scenarios.get(record.route) in ABILITIES[_SIGNS] and _bounds(record, True, {}) == (0.0, 1.0)
    )


def mean_rate(rates: Mapping[str, AbilityRate]) -> AbilityRate:
    """Return the plain mean of those that have routes."""
    known = [rate for rate in rates.values() if rate.routes]
    lows = [rate.low for rate in known if rate.low is not None]
    highs = [rate.high for rate in known if rate.high is not None]
    return AbilityRate(mean(lows) if lows else None, mean(highs) if highs else None, sum(rate.routes for rate in known))


def _rate(routes: list[list[OfficialRecord]], signs: bool, junctions: Mapping[str, float]) -> AbilityRate:
    if not routes:
        return AbilityRate(None, None, 0)
    bounds = [[_bounds(record, signs, junctions) for record in records] for records in routes]
    low = mean([mean([one[0] for one in of_route]) for of_route in bounds])
    return AbilityRate(low, mean([mean([one[1] for one in of_route]) for of_route in bounds]), len(routes))


def _bounds(record: OfficialRecord, signs: bool, junctions: Mapping[str, float]) -> tuple[float, float]:
    if record.is_success:
        return 1.0, 1.0
    if not signs or not record.obeyed_signs or record.route_pct <= 0.0:
        return 0.0, 0.0
    if record.route in junctions:
        passed: object = record.route_pct / 100.0 > junctions[record.route]
    else:
        passed = None if record.own is None else record.own.get("junction_passed")
    return (float(passed), float(passed)) if isinstance(passed, bool) else (0.0, 1.0)
