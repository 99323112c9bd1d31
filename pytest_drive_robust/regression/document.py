"""The JSON document of a run: writes it as text, reads it, and turns it into a snapshot."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from pytest_drive_robust.domain.result import EpisodeResult, merged_versions
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.regression.fingerprint import AgentPrint, Fingerprint
from pytest_drive_robust.regression.shape import misfit
from pytest_drive_robust.regression.snapshot import Cell, CellKey, RouteScore, Snapshot, Taken
from pytest_drive_robust.simulators.routes import ships
from pytest_drive_robust.store.episode_fields import result_of
from pytest_drive_robust.store.json_reader import read_json
from pytest_drive_robust.verdict.explain import describe_outcome

SCHEMA = 1
"""The `schema` of the documents that this version writes and reads.

Increase `SCHEMA` when a key changes its meaning or goes away, not when a key is added.
"""
_PARTS = ("settings", "summaries", "episodes")
"""The parts that every run has."""
_NOT_YET_TOLD: Mapping[str, Any] = {
    "speed_ratios_pct": (),
    "schedule": (),
    "privileged": False,
    "junction_passed": False,
    "versions": {},
}
"""Values of the episode fields that older runs lack."""
_OLDER_LACK = (
    ("", ("versions", "fingerprint", "requirements", "searches", "notes")),
    ("settings", ("agent", "routes", "seeds", "stuck_stop_s", "verdict", "margin", "alpha", "correction")),
    ("summary_row", ("privileged", "summary", "rd", "problem")),
    ("requirement", ("low", "high", "message", "planned", "rule", "p_value", "family", "margin")),
    ("episode", (*_NOT_YET_TOLD, "reception")),
)
"""The keys that older runs lack, by the part of the schema."""


def json_text(document: Mapping[str, object]) -> str:
    """Return a document as the text of a file. Raises `ValueError` for NaN and infinity, which JSON cannot hold."""
    return json.dumps(document, indent=2, allow_nan=False) + "\n"


def read_document(path: Path) -> dict[str, Any]:
    """Read the document in `path`. Raises `UsageError` for a file that is no run or has another schema."""
    return checked_document(read_json(path, name=f"the run {str(path)!r}"), path)


def checked_document(document: Any, path: Path) -> dict[str, Any]:
    """Return the value that was read from `path`. Raises `UsageError` for one that is no run or has another schema."""
    if not isinstance(document, dict) or any(name not in document for name in _PARTS):
        raise UsageError(f"{str(path)!r} is not a run: expected a file written by --drive-save or --drive-json.")
    if document.get("schema") != SCHEMA:
        raise UsageError(
            f"the run {str(path)!r} has schema {document.get('schema')!r}, this version reads {SCHEMA}. Drive it again."
        )
    wrong = misfit(document, "run", may_lack=_OLDER_LACK)
    if wrong:
        raise UsageError(f"the run {str(path)!r} is damaged: {wrong}.")
    return document


def snapshot_of(document: Mapping[str, Any], *, label: str) -> Snapshot:
    """Return the scores and the fingerprint of a run. Raises `UsageError` for a damaged document."""
    try:
        return _snapshot(document, label)
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        raise damaged(label, error) from None


def damaged(label: str, error: Exception) -> UsageError:
    """Return the error for a run with a missing or wrong part."""
    return UsageError(f"the run {label!r} is damaged: {type(error).__name__}: {error}.")


def routes_of_one_id(label: str, route_id: str, where: str = "") -> UsageError:
    """Return the error for a run with two routes of one id; `where` names the agent and the setting."""
    return UsageError(
        f"the run {label!r} holds two routes with the id {route_id!r}{where}, so they cannot be told apart. Give the "
        "routes of one file other ids, or drive the files in two runs."
    )


def _snapshot(document: Mapping[str, Any], label: str) -> Snapshot:
    """Return the snapshot of a document, its cells in the order of the summaries."""
    rows: dict[CellKey, list[Mapping[str, Any]]] = {}
    for row in document["summaries"]:
        rows.setdefault((row["agent"], row["setting"]), []).append(row)
    found: dict[CellKey, dict[str, list[Mapping[str, Any]]]] = {key: {} for key in rows}
    for episode in document["episodes"]:
        of_route = found.setdefault((episode["agent"], episode["setting"]), {}).setdefault(episode["route_id"], [])
        if episode["seed"] in [item["seed"] for item in of_route]:  # routes of two files must not be averaged
            where = f" for {episode['agent']} under {episode['setting']}"
            raise routes_of_one_id(label, episode["route_id"], where)
        of_route.append(episode)
    digests = document.get("fingerprint", {}).get("routes", {})
    prints = {agent: _fingerprint(document, agent) for agent in {agent for agent, _ in found}}
    cells = {key: _cell(key, rows.get(key, []), routes, digests, prints[key[0]]) for key, routes in found.items()}
    stored = document.get("stored") or {}  # a plain --drive-json file does not say
    date, commit = str(stored.get("date") or ""), str(stored.get("commit") or "")
    # older runs have neither `ended_early` nor `stopped_tests`
    ended_early, stopped_tests = document.get("ended_early") is True, tuple(document.get("stopped_tests", ()))
    return Snapshot(label, cells, date=date, commit=commit, ended_early=ended_early, stopped_tests=stopped_tests)


def _cell(
    key: CellKey,
    rows: Sequence[Mapping[str, Any]],
    routes: Mapping[str, Sequence[Mapping[str, Any]]],
    digests: Mapping[str, str],
    fingerprint: Fingerprint,
) -> Cell:
    """Return the cell of an agent under a setting from its `rows` of the summaries and the episodes of each route."""
    scores = {
        route_id: RouteScore.of(
            route_id,
            scored[0]["scenario"],
            [_taken(item) for item in scored],
            digest=digests.get(route_id, ""),
            fingerprint=fingerprint,
        )
        for route_id, items in routes.items()
        if (scored := [item for item in items if item["driving_score"] is not None])
    }
    broken = [
        f"{item['route_id']}, seed {item['seed']}: {item['end_detail']}"
        for items in routes.values()
        for item in items
        if item["driving_score"] is None
    ]
    if left := sum(row.get("episodes_needed", 0) - row.get("episodes_finished", 0) for row in rows):
        episodes = "episode was" if left == 1 else "episodes were"
        broken.append(f"{left} {episodes} not driven, as the run ended before, or a verdict was an error")
    stopped = [
        f"{row['routes']} of {row['routes_planned']} routes of {row['routes_spec']}"
        for row in rows
        if _stopped_early(row)
    ]
    return Cell(*key, _spec_of(rows), scores, tuple(broken), tuple(stopped))


def _spec_of(rows: Sequence[Mapping[str, Any]]) -> str:
    """Return the specification that finds every route of `rows`; empty if one of several names a user's file."""
    specs = dict.fromkeys(row["routes_spec"] for row in rows)
    return next(iter(specs), "") if len(specs) < 2 or all(map(ships, specs)) else ""


def _stopped_early(row: Mapping[str, Any]) -> bool:
    """Return whether verdicts were reached without some of the routes; False for older runs, which do not tell."""
    planned: int = row.get("routes_planned", 0) * len(row.get("seeds", ()))
    return bool(planned > row.get("episodes_needed", planned))


def _fingerprint(document: Mapping[str, Any], agent: str) -> Fingerprint:
    settings = document["settings"]
    told = document.get("fingerprint", {}).get("agents", {}).get(agent, {})
    return Fingerprint(
        simulator=settings["simulator"],
        stuck_stop_s=settings.get("stuck_stop_s"),
        agent=AgentPrint(**{name: told.get(name, "") for name in ("distribution", "source", "weights")}),
        versions=merged_versions(item.get("versions", {}) for item in document["episodes"] if item["agent"] == agent),
        plugins=tuple(settings.get("plugins", ())),  # older runs have no `plugins`
    )


def _taken(item: Mapping[str, Any]) -> Taken:
    outcome = describe_outcome(episode_of(item))  # the same words as in every report
    return Taken(int(item["seed"]), float(item["driving_score"]), bool(item["success"]), outcome)


def episode_of(item: Mapping[str, Any]) -> EpisodeResult:
    """Return the episode result of a document's item, without its trace, of which a document holds only the digest.

    Raises `KeyError`, `TypeError` or `ValueError` for an item with missing or wrong fields.
    """
    return result_of({**_NOT_YET_TOLD, **item})
