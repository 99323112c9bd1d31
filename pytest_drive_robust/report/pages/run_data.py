"""The data of a run's pages as one plain document, without the motion of the episodes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.errors import first_few
from pytest_drive_robust.metrics.ability import ABILITIES
from pytest_drive_robust.metrics.table import METRICS
from pytest_drive_robust.regression.clock import minute_text
from pytest_drive_robust.regression.comparison_result import Comparison
from pytest_drive_robust.report.failures.clusters import clusters_of
from pytest_drive_robust.report.failures.road import Road
from pytest_drive_robust.report.numbers import counted
from pytest_drive_robust.report.pages.compared import comparison_data, flipped
from pytest_drive_robust.report.pages.episodes import EpisodeTable
from pytest_drive_robust.report.pages.evidence import bound
from pytest_drive_robust.report.pages.judged import level_text, requirement_data
from pytest_drive_robust.report.road_map import RoadMaps
from pytest_drive_robust.report.run_records import RunRecords
from pytest_drive_robust.report.run_result import row_labels
from pytest_drive_robust.simulators.embedded.weathers import weather_name
from pytest_drive_robust.simulators.routes import ships


def run_data(
    records: RunRecords,
    table: EpisodeTable,
    *,
    maps: RoadMaps,
    comparison: Comparison | None,
    before: RunRecords | None,
) -> dict[str, Any]:
    """Return the document of the pages, and fill `table` with the episodes that the pages show."""
    document = records.document
    table.add(records, records.results)
    if comparison is not None and before is not None:
        table.add(before, flipped(comparison, before), run=1)
    return {
        "label": records.label,
        "endedEarly": document.get("ended_early", False),
        "stopped": len(document.get("stopped_tests", ())),
        "ownVerdicts": len(document.get("own_verdicts", ())),
        "stored": _stored(document),
        "options": document["settings"],
        "versions": document.get("versions", {}),
        "agents": document.get("fingerprint", {}).get("agents", {}),
        "notes": [*document.get("notes", ()), *_missing(records)],
        "searches": [item.get("sentence", "") for item in document.get("searches", ())],
        "metrics": {
            metric.name: {"decimals": metric.decimals, "meaning": metric.meaning, "unit": metric.unit}
            for metric in METRICS.values()
        },
        "rows": _rows(document["summaries"]),
        "requirements": [requirement_data(records, table, item) for item in document.get("requirements", ())],
        "level": level_text("evidence", records.alpha),
        "routes": _routes(records, table),
        "clusters": _clusters(records, table, maps),
        "episodes": table.as_data(),
        "comparison": None if comparison is None else comparison_data(comparison),
    }


def _rows(summaries: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    labels = row_labels([(row["setting"], row["routes_spec"], row["seeds"]) for row in summaries])
    return [{**_row(row), "label": label} for row, label in zip(summaries, labels, strict=True)]


def _row(row: Mapping[str, Any]) -> dict[str, Any]:
    summary = row.get("summary") or {}
    numbers = {"DS": summary.get("ds"), "SR": summary.get("sr"), "RD": row.get("rd")}
    numbers |= {"efficiency": summary.get("efficiency"), "comfort": summary.get("comfort")}
    return {
        "agent": row["agent"],
        "privileged": row.get("privileged", False),
        "setting": row["setting"],
        "numbers": numbers,
        "intervals": {"DS": row.get("ds_interval"), "RD": _finite(row.get("rd_interval"))},
        "routes": row["routes"],
        "planned": row.get("routes_planned", row["routes"]),
        "needed": row["episodes_needed"],
        "finished": row["episodes_finished"],
        "verdict": row["verdict"],
    }


def _finite(bounds: Sequence[float | None] | None) -> Sequence[float | None] | None:
    return None if bounds is None or None in map(bound, bounds) else bounds


def _routes(records: RunRecords, table: EpisodeTable) -> list[dict[str, Any]]:
    """Return each route of the episodes once; the place of a route in the list is the number of its data file."""
    found: dict[str, dict[str, Any]] = {}
    for result in table.results:
        route_id = result.episode.route_id
        if route_id in found:
            continue
        route = records.route(route_id)
        spec = records.spec_of(route_id)
        known = spec == records.document["settings"]["simulator"] or ships(spec)
        found[route_id] = {
            "id": route_id,
            # the file to find the route in; empty if the id is enough
            "file": "" if known else spec,
            "scenario": result.scenario,
            "town": "" if route is None else route.town,
            "weather": "" if route is None else weather_name(route.weather),
            "abilities": [name for name, types in ABILITIES.items() if result.scenario in types],
            "metres": round(result.route_length_m),
        }
    return list(found.values())


def _clusters(records: RunRecords, table: EpisodeTable, maps: RoadMaps) -> list[dict[str, Any]]:
    """Return the groups of the run's episodes that broke."""
    numbered = [(table.numbers[0, episode], result) for episode, result in records.results.items()]
    roads: dict[int, Road] = {}

    def road_of(result: EpisodeResult) -> Road | None:
        truth = maps.truth(records.route(result.episode.route_id), result.episode.seed)
        if truth is None or not len(result.trace.rows):
            return None
        return roads.setdefault(id(truth), Road(truth))

    return [
        {"name": item.name, "sentence": item.sentence, "episodes": item.episodes, "example": item.example}
        for item in clusters_of(numbered, road_of)
    ]


def _stored(document: Mapping[str, Any]) -> str:
    """Return when and from which commit the run was stored; empty for a run that is not stored."""
    stored = document.get("stored") or {}
    return ", ".join(filter(None, (minute_text(str(stored.get("date") or "")), stored.get("commit"))))


def _missing(records: RunRecords) -> list[str]:
    """Return a sentence for each setting with episodes not driven, and about what is no longer there to be shown."""
    lines = []
    for row in records.document["summaries"]:
        left = row["episodes_needed"] - row["episodes_finished"]
        if left > 0:
            lines.append(
                f"{row['agent']} under {row['setting']}: {left} of {counted(row['episodes_needed'], 'episode')} not "
                "driven, because the run ended before, or a verdict was an error."
            )
    unread = sum(result.ticks > 0 and not len(result.trace.rows) for result in records.results.values())
    if unread:
        lines.append(f"{unread} of {len(records.results)} episodes are not in the store, so they cannot be replayed.")
    if changed := records.changed_routes:
        lines.append(f"the roads of routes that are not as the run drove them are not shown: {first_few(changed, 5)}.")
    return lines
