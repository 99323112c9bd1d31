"""Sentences about the oddities of the official tools that change a number of these results, one for each."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence

from pytest_drive_robust.arithmetic.signals import mean
from pytest_drive_robust.bench2drive.results.episode_from_record import lane_shares_pct
from pytest_drive_robust.bench2drive.results.motion_log import Comforts
from pytest_drive_robust.bench2drive.results.official_record import (
    LARGEST_PCT,
    SPEED_LIST,
    OfficialRecord,
    official_speed_pct,
    ratios_pct,
    speed_pct,
)
from pytest_drive_robust.bench2drive.results.official_totals import (
    OFFICIAL_ROUTES,
    OfficialTotals,
    ability_route,
    counted_records,
    official_efficiency,
)
from pytest_drive_robust.bench2drive.results.results_file import ResultSet
from pytest_drive_robust.metrics.ability import SIGNS
from pytest_drive_robust.metrics.comfort import COMFORT_QUIRKS
from pytest_drive_robust.metrics.efficiency import LARGEST_RATIO_PCT

_SAME = 1e-9
_COMFORT = {
    "degrees": "the yaw rate is in degrees per second and its bound in radians",
    "unwrap": "jumps are taken out of the yaw rate as if it were an angle",
    "rate-twice": "the yaw rate stands in for the yaw acceleration",
    "half-jerk": "jerk is computed with 0.1 s between samples",
    "20-samples": "a segment is 20 samples, whatever their rate",
    "standing": "a car that stands is comfortable",
    "short-window": "logs of 3 to 6 samples count",
}


def notes_on(
    score: OfficialTotals, results: ResultSet, comforts: Comforts, *, scenarios: Mapping[str, str] | None = None
) -> tuple[str, ...]:
    """Return the sentences about a score; each begins with the name of the number that it is about."""
    official = score.mode == "bench2drive"
    parts = [_files(results), _rules(results), _foreign(score, results, scenarios)]
    if official:
        parts += [_totals(score, results), _efficiency(score, results)]
        parts += [_comfort_quirks(score, results, comforts), _abilities(score, scenarios)]
    else:
        parts += [_left_out(score)]
    parts += [_signs(score), _logs(score, results, comforts)]
    return tuple(note for part in parts for note in part)


def _files(results: ResultSet) -> Iterator[str]:
    for path in results.skipped:
        yield f"files: {path.name!a} holds no records and was left out"


def _rules(results: ResultSet) -> Iterator[str]:
    odd = [record for record in results.records if lane_shares_pct(record) is None]
    if odd:
        yield (
            f"DS: the scores of {len(odd)} records do not follow from their infractions (first: {odd[0].where}); "
            "they come from a leaderboard with other rules, or were edited"
        )


def _foreign(score: OfficialTotals, results: ResultSet, scenarios: Mapping[str, str] | None) -> Iterator[str]:
    if scenarios is None:
        return
    foreign = foreign_records(results.records, scenarios, mode=score.mode)
    if foreign:
        yield (
            f"DS, SR, abilities: {len(foreign)} records are of routes that the route file does not have "
            f"(first: {foreign[0].route!a}); they count in DS and SR, not in abilities"
        )


def foreign_records(
    records: Sequence[OfficialRecord], scenarios: Mapping[str, str], *, mode: str
) -> list[OfficialRecord]:
    """Return the records of routes that a route file, with these `scenarios`, does not have."""
    official = mode == "bench2drive"
    return [record for record in records if ability_route(record, official=official) not in scenarios]


def _totals(score: OfficialTotals, results: ResultSet) -> Iterator[str]:
    count = score.records
    assert score.ds is not None  # an official sum is never None
    assert score.sr is not None
    if count != OFFICIAL_ROUTES and (score.ds or score.sr):
        factor = OFFICIAL_ROUTES / count
        yield (
            f"DS, SR: divided by {OFFICIAL_ROUTES} though there are {count} records; "
            f"over the records DS is {score.ds * factor:.4f} and SR {score.sr * factor:.4f}"
        )
    counts = Counter(record.route for record in results.records)
    extra = sum(counts.values()) - len(counts)
    if extra:
        yield (
            f"DS, SR, efficiency, comfort: {extra} records of routes that are there already count as routes of their "
            "own; abilities take the last repetition"
        )
    if score.unscored:
        yield (
            f"DS, SR, efficiency, comfort, abilities: {len(score.unscored)} routes ended by a fault of the harness "
            f"(first: {score.unscored[0]!a}) and count with what they had until then"
        )


def _efficiency(score: OfficialTotals, results: ResultSet) -> Iterator[str]:
    ratios = [ratios_pct(record, read=official_speed_pct) for record in results.records]
    dropped = sum(ratio > LARGEST_RATIO_PCT for values in ratios for ratio in values)
    if dropped:
        finite = [kept for values in ratios if (kept := [value for value in values if value <= LARGEST_PCT])]
        told = f"{mean([mean(values) for values in finite]):.4f}" if finite else "unknown"
        yield f"efficiency: {dropped} values above 1000 % are dropped; with them it is {told}"
    empty = sum(not values for values in ratios)
    if empty and score.efficiency is not None:
        known = [value for record in results.records if (value := official_efficiency(record)) is not None]
        yield (
            f"efficiency: {empty} routes without a value (the car never reached a checkpoint) are left out; "
            f"as 0 they would make it {sum(known) / (len(known) + empty):.4f}"
        )
    only_large = sum(bool(values) and min(values) > LARGEST_RATIO_PCT for values in ratios)
    if only_large:
        yield f"efficiency: {only_large} routes have only values above 1000 %: the official tool stops with an error"
    elif score.efficiency is None:
        yield "efficiency: no route has a value: the official tool stops with an error"
    misread = sum(
        speed_pct(message) != official_speed_pct(message)
        for record in results.records
        for message in record.infractions[SPEED_LIST]
    )
    if misread:
        yield f"efficiency: {misread} values with a sign or an exponent are read without it"


def _comfort_quirks(score: OfficialTotals, results: ResultSet, comforts: Comforts) -> Iterator[str]:
    if score.comfort is None:
        return
    for quirk in COMFORT_QUIRKS:
        others = tuple(name for name in COMFORT_QUIRKS if name != quirk)
        values = [value for record in results.records if (value := comforts.with_quirks(record, others)) is not None]
        without = mean(values) if values else None
        if without is None or abs(without - score.comfort) > _SAME:
            shown = "unknown" if without is None else f"{without:.4f}"
            yield f"comfort: {_COMFORT[quirk]}; without that it is {shown}"


def _abilities(score: OfficialTotals, scenarios: Mapping[str, str] | None) -> Iterator[str]:
    empty = [name for name, rate in score.abilities.items() if not rate.routes]
    if empty:
        yield (
            f"abilities: there is no route of {', '.join(empty)}: the official tool divides by zero there; the mean "
            "is that of the others"
        )
    if score.missing and scenarios is not None:
        yield f"abilities: {len(score.missing)} missing routes are left out, though DS and SR count them as 0"


def _left_out(score: OfficialTotals) -> Iterator[str]:
    if score.unscored:
        yield (
            f"all: {len(score.unscored)} routes ended by a fault of the harness (first: {score.unscored[0]!a}) and "
            "are left out; drive them again"
        )
    if score.duplicates:
        yield f"all: {len(score.duplicates)} routes have several records of the same repetition, which were averaged"


def _signs(score: OfficialTotals) -> Iterator[str]:
    rate = score.abilities[SIGNS]
    if rate.routes and rate.value is None:
        yield (
            "Traffic_Signs, mean of abilities: a range: some routes failed with no sign ignored, and whether that was "
            "beyond the first junction only the map of their town tells: give --routes and --carla-root"
        )


def _logs(score: OfficialTotals, results: ResultSet, comforts: Comforts) -> Iterator[str]:
    records = counted_records(results, score.mode)
    if not score.comfort_records:
        yield "comfort: no metric_info.json was found; give its folder with --metric-dir"
    elif score.comfort_records < len(records):
        yield (
            f"comfort: the mean over {score.comfort_records} of {len(records)} records that have a metric_info.json of "
            "enough samples; the official tool stops at the first without one"
        )
    renamed = sum(comforts.is_renamed(record) for record in records)
    if renamed:
        yield (
            f"comfort: {renamed} logs are in folders with something before the save_name; the official tool finds "
            "them only when they are moved"
        )
