"""What stands for the official evaluator among the simulators, so that its name is listed and found when misspelt."""

from __future__ import annotations

from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.simulators.base import Simulator, SimulatorOptions


def official_evaluator(options: SimulatorOptions) -> Simulator:
    """Refuse: pytest alone drives by the official evaluator, and makes no world of ours for it."""
    raise UsageError(
        "bench2drive is the official evaluator, which is started by pytest only: "
        "pytest --drive-robust --drive-sim bench2drive --drive-b2d-root=FOLDER."
    )
