"""Arguments that commands share to find stored runs and baselines."""

from __future__ import annotations

import argparse
from pathlib import Path

from pytest_drive_robust.regression.references import References, project_home

A_RUN = "a stored run, latest, or the JSON file of a run"
"""Help of an argument that names a run."""


def add_run(parser: argparse.ArgumentParser) -> None:
    """Add the argument `RUN`."""
    parser.add_argument("run", metavar="RUN", help=A_RUN)


def references_of(options: argparse.Namespace) -> References:
    """Return the stored runs and baselines of the project; `--baselines` may name the folder of baselines."""
    return References(project_home(), Path(options.baselines) if options.baselines else None)
