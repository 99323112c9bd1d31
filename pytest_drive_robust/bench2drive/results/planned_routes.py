"""The list of routes that our runs of the evaluator plan: the official file of a route plans only that route."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path

from pytest_drive_robust.bench2drive.results.safe_json import printable, read_json
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.store.whole_file import write_whole

PLANNED_FILE = "drive_robust.planned"
"""The list of route ids as JSON, beside the results; not `*.json`, which the official merge tool takes for results."""


def planned_routes(folder: Path) -> tuple[str, ...]:
    """Return the ids of the routes that were planned for the results in `folder`; empty without a list.

    Raises `UsageError` for a damaged list, because without the list nobody knows whether the results are complete.
    """
    file = folder / PLANNED_FILE
    if not file.is_file():
        return ()
    ids = read_json(file)
    if not isinstance(ids, list) or not all(isinstance(name, str) for name in ids):
        raise UsageError(
            f"{printable(file)} is damaged: expected a list of route ids. Remove it and start the evaluation "
            "again, which drives only what is missing."
        )
    return tuple(ids)


def add_planned(folder: Path, routes: Iterable[str]) -> None:
    """Add routes to the list of planned routes. The caller must keep others from writing it at the same time."""
    before = planned_routes(folder)
    planned = tuple(dict.fromkeys((*before, *routes)))
    if planned != before:
        folder.mkdir(parents=True, exist_ok=True)
        write_whole(folder / PLANNED_FILE, json.dumps(planned), synced=True)
