"""The official totals of a set of records: `bench2drive` as the official tools compute them, `fixed` without quirks.

Sources: Bench2Drive `tools/merge_route_json.py` (DS, SR), `tools/efficiency_smoothness_benchmark.py` (efficiency,
comfort), `tools/ability_benchmark.py` (abilities).

============ ====================================================== =============================================
total        bench2drive                                            fixed
============ ====================================================== =============================================
DS, SR       sum over records / 220                                 mean over the routes that were scored
             a route that is there twice counts twice               its records are averaged
             what ended by a fault of the harness counts            left out, and listed
efficiency   values above 1000 % dropped, routes without one left   kept, and 0 for a route without one
             out, mean over records                                 mean over routes
comfort      see `metrics.comfort`                                  see `metrics.comfort`
abilities    of a route the last repetition counts                  its records are averaged
             an ability without a route divides by zero             left out of the mean
============ ====================================================== =============================================

Traffic_Signs has a rule of its own: a failed route counts there when the car came 8 waypoints beyond the first
junction without running a red light or a stop sign. Only the map of the town tells where the first junction is. So
without our own mark in the record, we know only two bounds of the rate of Traffic_Signs.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from pytest_drive_robust.arithmetic.signals import mean
from pytest_drive_robust.bench2drive.results.motion_log import Comforts
from pytest_drive_robust.bench2drive.results.official_record import OfficialRecord, official_speed_pct, ratios_pct
from pytest_drive_robust.bench2drive.results.results_file import ResultSet
from pytest_drive_robust.domain.outcome import InfractionKind
from pytest_drive_robust.metrics.ability import ABILITIES, SIGNS
from pytest_drive_robust.metrics.efficiency import LARGEST_RATIO_PCT
from pytest_drive_robust.metrics.episodes import require_mode

OFFICIAL_ROUTES = 220
"""The official merge tool divides by this number, whatever was driven."""
_OBEYED = (InfractionKind.RED_LIGHT.value, InfractionKind.STOP_SIGN.value)


@dataclass(frozen=True, slots=True)
class AbilityRate:
    """A success rate between `low` and `high` (0..1), both None without a route; `routes` is the number of routes."""

    low: float | None
    high: float | None
    routes: int

    @property
    def value(self) -> float | None:
        """The rate if it is known exactly, else None."""
        return self.low if self.low == self.high else None


@dataclass(frozen=True, slots=True)
class OfficialTotals:
    """`ds` is 0..100, `sr` 0..1, `efficiency` and `comfort` percent; None where no route has data.

    `records` records of `routes` routes were read; `comfort_records` of them had a log of their motion. `missing` are
    the ids of planned routes without a record, None if only their number is known; `missing_count` is this number, None
    if it is unknown. `unscored` are the route ids whose end says nothing about the agent.
    """

    mode: str
    ds: float | None
    sr: float | None
    efficiency: float | None
    comfort: float | None
    abilities: Mapping[str, AbilityRate]
    mean_ability: AbilityRate
    records: int
    routes: int
    comfort_records: int
    statuses: Mapping[str, int]
    duplicates: tuple[str, ...] = ()
    unscored: tuple[str, ...] = ()
    missing: tuple[str, ...] | None = None
    missing_count: int | None = None


def score_results(
    results: ResultSet,
    comforts: Comforts,
    *,
    mode: str,
    scenarios: Mapping[str, str] | None = None,
    junctions: Mapping[str, float] | None = None,
) -> OfficialTotals:
    """Return the totals.

    `scenarios` are the planned routes of a route file, id to scenario type; `junctions` are the results of
    `carla_junctions.junction_shares` for some of these routes.

    Raises `UnknownNameError` for an unknown mode, `UsageError` for a damaged log of motion or a sentence without its
    number.
    """
    require_mode(mode)
    official = mode == "bench2drive"
    counted = counted_records(results, mode)
    comfort_values = [(record, value) for record in counted if (value := comforts.value(record, mode)) is not None]
    efficiency_of = official_efficiency if official else _true_efficiency
    efficiencies = [(record, value) for record in counted if (value := efficiency_of(record)) is not None]
    rates = _ability_rates(counted, scenarios, official=official, junctions=junctions or {})
    ids, count = _missing(results, scenarios, otherwise=OFFICIAL_ROUTES if official else None)
    total = _over_220 if official else _over_routes
    average = _over_records if official else _over_routes
    return OfficialTotals(
        mode=mode,
        ds=total([(record, record.score) for record in counted]),
        sr=total([(record, float(record.is_success)) for record in counted]),
        efficiency=average(efficiencies),
        comfort=average(comfort_values),
        abilities=rates,
        mean_ability=_mean_rate(rates),
        records=len(results.records),
        routes=len({record.route for record in results.records}),
        comfort_records=len(comfort_values),
        statuses=dict(sorted(Counter(record.status for record in results.records).items())),
        duplicates=results.duplicates,
        unscored=tuple(dict.fromkeys(record.route_id for record in results.records if record.is_harness_error)),
        missing=ids,
        missing_count=count,
    )


def counted_records(results: ResultSet, mode: str) -> tuple[OfficialRecord, ...]:
    """Return the records that count: all in the mode `bench2drive`, else those whose end tells about the agent."""
    if mode == "bench2drive":
        return results.records
    return tuple(record for record in results.records if not record.is_harness_error)


def official_efficiency(record: OfficialRecord) -> float | None:
    """Return the mean of the ratios up to 1000 %, None without any: the official tool skips the route or fails."""
    kept = [ratio for ratio in ratios_pct(record, read=official_speed_pct) if ratio <= LARGEST_RATIO_PCT]
    return mean(kept) if kept else None


def _true_efficiency(record: OfficialRecord) -> float:
    """Return the mean of all speed ratios in percent, 0 for a car that never reached a checkpoint."""
    ratios = ratios_pct(record)
    return mean(ratios) if ratios else 0.0


Values = Sequence[tuple[OfficialRecord, float]]


def _over_220(values: Values) -> float | None:
    return sum(value for _, value in values) / OFFICIAL_ROUTES


def _over_records(values: Values) -> float | None:
    return mean([value for _, value in values]) if values else None


def _over_routes(values: Values) -> float | None:
    """Return the mean over routes, the repetitions of a route averaged first."""
    found: dict[str, list[float]] = {}
    for record, value in values:
        found.setdefault(record.route, []).append(value)
    return mean([mean(of_route) for of_route in found.values()]) if found else None


def _missing(
    results: ResultSet, scenarios: Mapping[str, str] | None, *, otherwise: int | None
) -> tuple[tuple[str, ...] | None, int | None]:
    """Return the missing routes and their number, each None if unknown.

    Without a route file the evaluator's own plan tells the planned routes, or how many each file lacks: files may plan
    the same routes. Without a plan, `otherwise` is the number of planned routes.
    """
    there = {record.route for record in results.records}
    if scenarios is not None:
        absent = tuple(route for route in scenarios if route not in there)
        return absent, len(absent)
    if results.missing:
        return results.missing, len(results.missing)
    if results.planned is not None:
        return None, sum((file.planned or 0) - file.held for file in results.unfinished)
    if otherwise is None:
        return None, None
    return None, max(otherwise - len({record.route_id for record in results.records}), 0)


def _ability_rates(
    records: Iterable[OfficialRecord],
    scenarios: Mapping[str, str] | None,
    *,
    official: bool,
    junctions: Mapping[str, float],
) -> dict[str, AbilityRate]:
    """Count the successes of each ability.

    `scenarios`: count only these routes, with these types. `official`: count only the record of a route that the
    official ability tool finds first; the merge tool sorts records by id as text, the last repetition first.
    `junctions`: the share of each route after which its first junction is passed, where it is known.
    """
    by_route: dict[str, list[OfficialRecord]] = {}
    for record in sorted(records, key=lambda record: record.route_id, reverse=True) if official else records:
        found = by_route.setdefault(ability_route(record, official=official), [])
        if not (official and found):
            found.append(record)
    kept = {route: found for route, found in by_route.items() if scenarios is None or route in scenarios}
    types = {route: found[0].scenario if scenarios is None else scenarios[route] for route, found in kept.items()}
    return {
        ability: _rate([found for route, found in kept.items() if types[route] in members], ability == SIGNS, junctions)
        for ability, members in ABILITIES.items()
    }


def ability_route(record: OfficialRecord, *, official: bool) -> str:
    """Return the route that a record counts for in abilities: the official tool cuts the id at the first underscore."""
    return record.route.partition("_")[0] if official else record.route


def undecided_routes(records: Iterable[OfficialRecord], scenarios: Mapping[str, str]) -> frozenset[str]:
    """Return the routes of Traffic_Signs for which only a map can tell whether they count."""
    return frozenset(
        record.route
        for record in records
        if scenarios.get(record.route) in ABILITIES[SIGNS] and _bounds(record, True, {}) == (0.0, 1.0)
    )


def _mean_rate(rates: Mapping[str, AbilityRate]) -> AbilityRate:
    """Return the plain mean of the abilities that have routes."""
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
    if not signs or any(record.infractions[name] for name in _OBEYED) or record.route_pct <= 0.0:
        return 0.0, 0.0
    if record.route in junctions:
        passed: object = record.route_pct / 100.0 > junctions[record.route]
    else:
        passed = None if record.own is None else record.own.get("junction_passed")
    return (float(passed), float(passed)) if isinstance(passed, bool) else (0.0, 1.0)
