"""The eleven settings of Bench2Drive-Robust (Tab. 2 of the paper) as requirements, for the agent under test.

In two readings, each with its own limits: `paper`, its equations, which runs unless the other one is chosen, and
`released`, what its released code does. `conftest.py` says how one chooses.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from pytest_drive_robust import Requirement, requirements

PAPER, RELEASED = (requirements(Path(__file__).with_name(name)) for name in ("limits.txt", "limits_released.txt"))


@pytest.mark.drive_robust(reading="paper")
@pytest.mark.parametrize("requirement", PAPER)
def test_paper_reading(drive, requirement: Requirement) -> None:
    drive.check(requirement)


@pytest.mark.drive_robust(reading="released")
@pytest.mark.parametrize("requirement", RELEASED)
def test_released_reading(drive, requirement: Requirement) -> None:
    drive.check(requirement)
