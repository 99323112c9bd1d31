"""Which routes our own evaluator set out to drive: its official file of each route plans that one route only."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path

from pytest_drive_robust.bench2drive.results.safe_json import read_json, shown
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.store.whole_file import write_whole

PLANNED_FILE = "drive_robust.planned"
"""Beside the results, a list of ids as JSON; no `*.json`, all of which the official merge tool takes for results."""


def planned_routes(folder: Path) -> tuple[str, ...]:
    """Return the ids of the routes that the results in `folder` were planned to be of; none where nothing tells.

    Raises `UsageError` for a damaged list: who cannot read it does not know that the results are whole.
    """
    file = folder / PLANNED_FILE
    if not file.is_file():
        return ()
    ids = read_json(file)
    if not isinstance(ids, list) or not all(isinstance(name, str) for name in ids):
        raise UsageError(
            f"{shown(file)} is damaged: expected a list of route ids. Remove it and start the evaluation "
            "again, which drives only what is missing."
        )
    return tuple(ids)


def add_planned(folder: Path, routes: Iterable[str]) -> None:
    """Note that these routes are to be driven too. The caller sees to it that nobody else does so at the same time."""
    before = planned_routes(folder)
    planned = tuple(dict.fromkeys((*before, *routes)))
    if planned != before:
        folder.mkdir(parents=True, exist_ok=True)
        write_whole(folder / PLANNED_FILE, json.dumps(planned), synced=True)
