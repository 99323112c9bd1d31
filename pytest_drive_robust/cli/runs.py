"""`drive-robust runs`: the runs that `--drive-save` stored."""

from __future__ import annotations

import argparse
from pathlib import Path

from pytest_drive_robust.cli.tables import LEFT, RIGHT, print_table
from pytest_drive_robust.regression.runs import StoredRuns, home_of

__all__ = ["add_arguments"]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add `runs list`."""
    what = parser.add_subparsers(required=True, metavar="WHAT")
    listing = what.add_parser("list", help="name, date, commit, agents and size of each, the oldest first")
    listing.set_defaults(command=_list)


def _list(options: argparse.Namespace) -> int:
    runs = StoredRuns(home_of(Path.cwd())).runs()
    if not runs:
        print("no stored run. Store one with pytest --drive-robust --drive-save")
        return 0
    rows = [
        (run.name, "not a run")
        if run.problem
        else (
            *(run.name, run.date.partition("+")[0], run.commit, ", ".join(run.agents)),
            *(str(run.settings), str(run.episodes)),
        )
        for run in runs
    ]
    words = dict.fromkeys(("name", "date", "commit", "agents"), LEFT)
    print_table({**words, "settings": RIGHT, "episodes": RIGHT}, rows)
    for run in runs:
        if run.problem:
            print(run.problem)
    return 0
