"""The registered simulator `bench2drive`, so that this name is listed and suggested for a misspelt one."""

from __future__ import annotations

from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.simulators.base import Simulator, SimulatorOptions


def official_evaluator(options: SimulatorOptions) -> Simulator:
    """Raise `UsageError`: no simulator object exists for the official evaluator, which drives by itself."""
    raise UsageError(
        "bench2drive is the official evaluator, which drives by itself: start it by "
        "pytest --drive-robust --drive-sim bench2drive --drive-b2d-root=FOLDER, or without pytest by "
        "python -m pytest_drive_robust.bench2drive.evaluator run."
    )
