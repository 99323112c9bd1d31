"""From a run's JSON document to a snapshot."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from pytest_drive_robust.domain.episode import Episode
from pytest_drive_robust.domain.outcome import End, Infraction, InfractionKind, Outcome
from pytest_drive_robust.domain.result import EpisodeResult, Injection, Trace, merged_versions
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.regression.fingerprint import AgentPrint, Fingerprint
from pytest_drive_robust.regression.snapshot import Cell, CellKey, RouteScore, Snapshot, Taken
from pytest_drive_robust.verdict.explain import describe_outcome

__all__ = ["READS_SCHEMA", "episode_of", "read_document", "snapshot_of"]

READS_SCHEMA = 1
"""The `schema` of the runs that are understood here."""


def read_document(path: Path) -> dict[str, Any]:
    """Read the document in `path`. Raises `UsageError` for what is no run of a schema that we know."""
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise UsageError(f"the run {str(path)!r} cannot be read: {error.strerror}.") from None
    except ValueError as error:
        raise UsageError(f"the run {str(path)!r} is no JSON: {error}.") from None
    known = ("settings", "summaries", "episodes")
    if not isinstance(document, dict) or any(name not in document for name in known):
        raise UsageError(f"{str(path)!r} is no run: expected a file written by --drive-save or --drive-json.")
    if document.get("schema") != READS_SCHEMA:
        raise UsageError(
            f"the run {str(path)!r} has schema {document.get('schema')!r}, this version reads {READS_SCHEMA}. "
            "Drive it again."
        )
    return document


def snapshot_of(document: Mapping[str, Any], *, label: str) -> Snapshot:
    """Return the scores and the fingerprint of a run. Raises `UsageError` for a document that lacks what runs have."""
    try:
        return _Reader(document, label).snapshot()
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        raise UsageError(f"the run {label!r} is damaged: {type(error).__name__}: {error}.") from None


class _Reader:
    def __init__(self, document: Mapping[str, Any], label: str) -> None:
        self._document = document
        self._label = label
        self._routes: Mapping[str, str] = document.get("fingerprint", {}).get("routes", {})
        self._prints: dict[str, Fingerprint] = {}

    def snapshot(self) -> Snapshot:
        """Return cells in the order of the summaries."""
        found: dict[CellKey, dict[str, list[Mapping[str, Any]]]] = {}
        specs: dict[CellKey, str] = {}
        for row in self._document["summaries"]:
            key = row["agent"], row["setting"]
            found.setdefault(key, {})
            specs.setdefault(key, row["routes_spec"])
        for episode in self._document["episodes"]:
            key = episode["agent"], episode["setting"]
            found.setdefault(key, {}).setdefault(episode["route_id"], []).append(episode)
        cells = {key: self._cell(key, specs.get(key, ""), routes) for key, routes in found.items()}
        stored = self._document.get("stored") or {}  # a plain --drive-json file does not say
        return Snapshot(self._label, cells, date=stored.get("date") or "", commit=stored.get("commit") or "")

    def _cell(self, key: CellKey, routes_spec: str, routes: Mapping[str, list[Mapping[str, Any]]]) -> Cell:
        scores, broken = {}, []
        for route_id, episodes in routes.items():
            self._require_one_route(key, route_id, episodes)
            scored = [item for item in episodes if item["driving_score"] is not None]
            broken += [
                f"{route_id}, seed {item['seed']}: {item['end_detail']}" for item in episodes if item not in scored
            ]
            if scored:
                scores[route_id] = RouteScore.of(
                    route_id,
                    scored[0]["scenario"],
                    [_taken(item) for item in scored],
                    digest=self._routes.get(route_id, ""),
                    fingerprint=self._fingerprint(key[0]),
                )
        return Cell(*key, routes_spec, scores, tuple(broken))

    def _require_one_route(self, key: CellKey, route_id: str, episodes: Iterable[Mapping[str, Any]]) -> None:
        """Refuse two routes of one id, as of two files that a run drove: their episodes must not be averaged."""
        seeds = [item["seed"] for item in episodes]
        if len(set(seeds)) != len(seeds):
            raise UsageError(
                f"the run {self._label!r} holds two routes with the id {route_id!r} for {key[0]} under {key[1]}, so "
                "they cannot be told apart. Give the routes of one file other ids, or drive the files in two runs."
            )

    def _fingerprint(self, agent: str) -> Fingerprint:
        if agent not in self._prints:
            settings = self._document["settings"]
            told = self._document.get("fingerprint", {}).get("agents", {}).get(agent, {})
            self._prints[agent] = Fingerprint(
                simulator=settings["simulator"],
                stuck_stop_s=settings.get("stuck_stop_s"),
                agent=AgentPrint(**{name: told.get(name, "") for name in ("distribution", "source", "weights")}),
                versions=merged_versions(
                    item.get("versions", {}) for item in self._document["episodes"] if item["agent"] == agent
                ),
                plugins=tuple(settings.get("plugins", ())),  # runs that were saved before these were told lack them
            )
        return self._prints[agent]


def _taken(item: Mapping[str, Any]) -> Taken:
    outcome = describe_outcome(episode_of(item))  # the words that every report uses
    return Taken(int(item["seed"]), float(item["driving_score"]), bool(item["success"]), outcome)


def episode_of(item: Mapping[str, Any]) -> EpisodeResult:
    """Return the result that a document tells of: all but its trajectory, of which a document holds the digest only.

    Raises `KeyError`, `TypeError` or `ValueError` for an item that lacks what episodes have.
    """
    return EpisodeResult(
        episode=Episode(item["agent"], item["route_id"], item["setting"], item["seed"]),
        scenario=item["scenario"],
        outcome=Outcome(item["outcome"]),
        end=End(item["end"]),
        end_detail=item["end_detail"],
        route_completion_pct=item["route_completion_pct"],
        route_length_m=item["route_length_m"],
        infractions=tuple(
            Infraction(**{**event, "kind": InfractionKind(event["kind"])}) for event in item["infractions"]
        ),
        speed_ratios_pct=tuple(item.get("speed_ratios_pct", ())),
        ticks=item["ticks"],
        dt_s=item["dt_s"],
        wall_s=item["wall_s"],
        trace=Trace(np.zeros((0, len(Trace.COLUMNS)))),
        schedule=tuple(Injection(**stretch) for stretch in item.get("schedule", ())),
        privileged=item.get("privileged", False),
    )
