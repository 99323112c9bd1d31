"""Does the tool work here? The privileged expert drives every route clean and under mild failures."""

from __future__ import annotations

from pathlib import Path

import pytest

from pytest_drive_robust import Requirement, requirements

pytestmark = pytest.mark.drive_robust(agent="expert")

LIMITS = Path(__file__).with_name("limits.txt")


@pytest.mark.parametrize("requirement", requirements(LIMITS))
def test_expert(drive, requirement: Requirement) -> None:
    drive.check(requirement)
