"""`drive-robust runs`: the runs that `--drive-save` stored."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from typing import Any

from pytest_drive_robust.cli.tables import LEFT, RIGHT, print_table
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.regression.clock import minute_text
from pytest_drive_robust.regression.document import read_document
from pytest_drive_robust.regression.references import StoredRuns, project_home


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add `runs list`."""
    what = parser.add_subparsers(required=True, metavar="WHAT")
    listing = what.add_parser("list", help="list name, date, commit, agents and size of each run, the oldest first")
    listing.set_defaults(command=_list)


def _list(options: argparse.Namespace) -> int:
    runs = StoredRuns(project_home())
    rows, problems = [], []
    for name in runs.names():
        try:
            rows.append(_row(name, read_document(runs.path / f"{name}.json")))
        except UsageError as error:  # noqa: PERF203 - the others are listed all the same
            rows.append((name, "not a run"))
            problems.append(str(error))
    if not rows:
        print("no stored run. Store one with pytest --drive-robust --drive-save")
        return 0
    words = dict.fromkeys(("name", "date", "commit", "agents"), LEFT)
    print_table({**words, "settings": RIGHT, "episodes": RIGHT}, rows)
    print(*problems, sep="\n", end="\n" if problems else "")
    return 0


def _row(name: str, document: Mapping[str, Any]) -> tuple[str, ...]:
    stored, rows = document.get("stored") or {}, document["summaries"]
    agents, settings = dict.fromkeys(row["agent"] for row in rows), {row["setting"] for row in rows}
    date = minute_text(str(stored.get("date") or ""))
    counts = str(len(settings)), str(len(document["episodes"]))
    return name, date, str(stored.get("commit") or ""), ", ".join(agents), *counts
