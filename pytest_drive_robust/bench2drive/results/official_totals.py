"""The official totals of a set of records: `bench2drive` as the official tools compute them, `fixed` without quirks.

Sources: Bench2Drive `tools/merge_route_json.py` (DS, SR), `tools/efficiency_smoothness_benchmark.py` (efficiency,
comfort), `tools/ability_benchmark.py` (abilities).

============ ====================================================== =============================================
total        bench2drive                                            fixed
============ ====================================================== =============================================
DS, SR       sum over records / 220                                 mean over the routes that were scored
             a route that is there twice counts twice               its records are averaged
             an ending that is the harness's fault counts           left out, and listed
efficiency   values above 1000 % dropped, routes without one left   kept, and 0 for a route without one
             out, mean over records                                 mean over routes
comfort      see `metrics.comfort`                                  see `metrics.comfort`
abilities    the first record of a route counts                     its records are averaged
             an ability without a route divides by zero             left out of the mean
============ ====================================================== =============================================
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from pytest_drive_robust.bench2drive.results.ability_rates import AbilityRate, ability_rates, mean_rate
from pytest_drive_robust.bench2drive.results.comforts import Comforts
from pytest_drive_robust.bench2drive.results.efficiencies import official_efficiency, true_efficiency
from pytest_drive_robust.bench2drive.results.official_record import OfficialRecord
from pytest_drive_robust.bench2drive.results.results_file import ResultSet
from pytest_drive_robust.metrics.averages import mean
from pytest_drive_robust.metrics.guards import require_mode

__all__ = ["OFFICIAL_ROUTES", "OfficialTotals", "score_results"]

OFFICIAL_ROUTES = 220
"""What the official merge tool divides by, whatever was driven."""


@dataclass(frozen=True, slots=True)
class OfficialTotals:
    """`ds` is 0..100, `sr` 0..1, `efficiency` and `comfort` percent; None where no route has data.

    `records` of `routes` routes were read; `comfort_records` of them had a log of their motion. `missing` are the ids
    of planned routes without a record, None when only `missing_count` is known, and that is None when nobody knows.
    `unscored` are the route ids whose end says nothing about the agent.
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
    mode: str = "bench2drive",
    scenarios: Mapping[str, str] | None = None,
    junctions: Mapping[str, float] | None = None,
) -> OfficialTotals:
    """Return the totals.

    `scenarios` are the planned routes, id to scenario type, as a route file tells them; `junctions` is what
    `carla_junctions.junction_shares` knows about some of them.

    Raises `UnknownNameError` for a mode, `UsageError` for a damaged log of motion or a sentence without its number.
    """
    require_mode(mode)
    official = mode == "bench2drive"
    scorable = [record for record in results.records if not record.is_harness_error]
    counted = results.records if official else scorable
    comfort_values = [(record, value) for record in counted if (value := comforts.value(record, mode)) is not None]
    efficiency_of = official_efficiency if official else true_efficiency
    efficiencies = [(record, value) for record in counted if (value := efficiency_of(record)) is not None]
    rates = ability_rates(counted, scenarios, official=official, junctions=junctions)
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
        mean_ability=mean_rate(rates),
        records=len(results.records),
        routes=len({record.route for record in results.records}),
        comfort_records=len(comfort_values),
        statuses=dict(sorted(Counter(record.status for record in results.records).items())),
        duplicates=results.duplicates,
        unscored=tuple(dict.fromkeys(record.route_id for record in results.records if record.is_harness_error)),
        missing=ids,
        missing_count=count,
    )


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
    """Return which and how many; without a route file the evaluator's own plan tells how many, else `otherwise`."""
    there = {record.route for record in results.records}
    if scenarios is not None:
        absent = tuple(route for route in scenarios if route not in there)
        return absent, len(absent)
    planned = otherwise if results.planned is None else results.planned
    if planned is None:
        return None, None
    return None, max(planned - len({record.route_id for record in results.records}), 0)
