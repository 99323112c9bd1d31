"""What commands share that find stored runs and baselines by what people type."""

from __future__ import annotations

import argparse
from pathlib import Path

from pytest_drive_robust.regression.references import References, project_home

A_RUN = "a stored run, latest, or the JSON file of a run"
"""What people may type where a command takes a run."""


def add_run(parser: argparse.ArgumentParser) -> None:
    """Add the argument `RUN`."""
    parser.add_argument("run", metavar="RUN", help=A_RUN)


def references_of(options: argparse.Namespace) -> References:
    """Return what finds stored runs and baselines, of which `--baselines` may name the folder."""
    return References(project_home(), Path(options.baselines) if options.baselines else None)
