"""Write a run in the official schema: `results.json` and a `metric_info.json` per route, a folder per result set.

The official tools run on each of these folders: `merge_route_json.py -f FOLDER`, then
`efficiency_smoothness_benchmark.py -f FOLDER/merged.json -m FOLDER`, and with `CARLA_ROOT=DIR/carla`
`ability_benchmark.py -f FOLDER/routes.xml -r FOLDER/merged.json` (see `ability_map`).
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

from pytest_drive_robust.bench2drive.results.ability_map import MAPS_FOLDER, TOWNS, map_text, routes_text
from pytest_drive_robust.bench2drive.results.episode_from_record import EPISODE_FILE, episode_from_fields
from pytest_drive_robust.bench2drive.results.motion_log import FILE_NAME, log_text
from pytest_drive_robust.bench2drive.results.safe_json import printable
from pytest_drive_robust.bench2drive.results.writing import record_of, results_document
from pytest_drive_robust.domain.outcome import Outcome
from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.store.base import Find
from pytest_drive_robust.store.record_files import write_episode
from pytest_drive_robust.store.whole_file import write_whole

CARLA_FOLDER = "carla"
"""The folder that the official ability tool takes as the CARLA installation."""
_UNKNOWN_TOWN = "Unknown"
_NO_TIME = "01_01_00_00_00"


@dataclass(frozen=True, slots=True)
class Exported:
    """One written folder: `logs` of its `records` have a `metric_info.json`, `broken` of them are `infra_error`."""

    folder: Path
    agent: str
    setting: str
    seed: int
    records: int
    logs: int
    broken: int


def export_run(
    document: Mapping[str, Any], folder: Path, *, find: Find, towns: Mapping[str, str] | None = None
) -> tuple[Exported, ...]:
    """Write every (agent, setting, seed) of a run below `folder`, which must be empty or not exist yet.

    `document` is a run as JSON; `find` gives the stored episode of a key, with its ticks, or None; `towns` names the
    town of each route. Raises `UsageError` for a damaged document and for what the official schema cannot hold.
    """
    _require_free(folder)
    groups: dict[tuple[str, str, int], list[EpisodeResult]] = {}
    for number, fields in enumerate(document["episodes"]):
        result = _episode(fields, find, where=f"episode {number} of the run")
        key = result.episode.agent, result.episode.setting, result.episode.seed
        groups.setdefault(key, []).append(result)
    if not groups:
        raise UsageError("the run holds no episode to export.")
    names = _folder_names(list(groups))
    for results in groups.values():
        _require_exportable(results)
    stamp = _stamp(document)
    try:
        written = tuple(
            _write(folder.joinpath(*names[key]), results, towns or {}, stamp) for key, results in groups.items()
        )
        maps = folder.joinpath(CARLA_FOLDER, *MAPS_FOLDER)
        maps.mkdir(parents=True)
        for town in TOWNS:
            write_whole(maps / f"{town}.xodr", map_text(town))
        return written
    except OSError as error:
        raise UsageError(f"cannot write to {printable(folder)}: {error.strerror}.") from None


def _require_free(folder: Path) -> None:
    try:
        taken = folder.exists() and (not folder.is_dir() or any(folder.iterdir()))
    except OSError as error:
        raise UsageError(f"cannot write to {printable(folder)}: {error.strerror}.") from None
    if taken:
        raise UsageError(f"{printable(folder)} is there already and not empty. Give a new folder.")


def _episode(fields: object, find: Find, *, where: str) -> EpisodeResult:
    """Return the stored episode if its trace is the same, else the episode of the document, without ticks."""
    if not isinstance(fields, dict):
        raise UsageError(f"{where} is damaged: expected an object.")
    told = episode_from_fields(fields, where=where)
    stored = find(str(fields.get("key")))
    if stored is not None and stored.episode == told.episode and stored.trace.digest == fields.get("trace_digest"):
        return stored
    return told


def _require_exportable(results: list[EpisodeResult]) -> None:
    seen: set[str] = set()
    for result in results:
        route = result.episode.route_id
        if not re.fullmatch(r"[A-Za-z0-9.+-]{1,200}", route):
            raise UsageError(
                f"the route {printable(route)} cannot be exported: official tools cut ids at '_' and make file names "
                "of them. Expected letters, digits and . + -"
            )
        if route in seen:
            raise UsageError(
                f"the run holds two routes with the id {route!r} for {result.episode.agent} under "
                f"{result.episode.setting}: official records cannot tell them apart."
            )
        seen.add(route)


def _write(folder: Path, results: list[EpisodeResult], towns: Mapping[str, str], stamp: str) -> Exported:
    folder.mkdir(parents=True)
    records, logs = [], 0
    for index, result in enumerate(results):
        town = towns.get(result.episode.route_id, _UNKNOWN_TOWN)
        record = record_of(result, index=index, town=town, stamp=stamp)
        records.append(record)
        if len(result.trace.rows):
            place = folder / record["save_name"]
            place.mkdir()
            write_whole(place / FILE_NAME, log_text(result.trace))
            write_episode(place / EPISODE_FILE, result)
            logs += 1
    write_whole(folder / "results.json", json.dumps(results_document(records), indent=4, allow_nan=False) + "\n")
    write_whole(folder / "routes.xml", routes_text(results))
    first = results[0].episode
    broken = sum(result.outcome is Outcome.INFRA_ERROR for result in results)
    return Exported(folder, first.agent, first.setting, first.seed, len(records), logs, broken)


def _folder_names(keys: list[tuple[str, str, int]]) -> dict[tuple[str, str, int], tuple[str, str, str]]:
    """Return the folder of each key as (agent, setting, seed), with a number where two names would be the same."""
    taken: set[tuple[str, str, str]] = set()
    names = {}
    for agent, setting, seed in keys:
        top = _file_name(agent)
        top = f"{top}-agent" if top.lower() == CARLA_FOLDER else top
        number, name = 1, (top, _file_name(setting), f"seed{seed}")
        while tuple(part.lower() for part in name) in taken:
            number += 1
            name = (top, f"{_file_name(setting)}-{number}", f"seed{seed}")
        taken.add((name[0].lower(), name[1].lower(), name[2]))
        names[agent, setting, seed] = name
    return names


def _file_name(text: str) -> str:
    return re.sub(r"[^A-Za-z0-9.]+", "-", text).strip("-.")[:100] or "x"


def _stamp(document: Mapping[str, Any]) -> str:
    """Return the time at which the run was stored, as the evaluator writes times; a fixed text without a time."""
    stored = document.get("stored")
    date = stored.get("date") if isinstance(stored, dict) else None
    try:
        return f"{datetime.fromisoformat(date):%m_%d_%H_%M_%S}" if isinstance(date, str) else _NO_TIME
    except ValueError:
        return _NO_TIME
