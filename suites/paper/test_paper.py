"""The eleven settings of Bench2Drive-Robust (Tab. 2 of the paper) as requirements, for the agent under test."""

from __future__ import annotations

from pathlib import Path

import pytest

from pytest_drive_robust import Requirement, requirements

LIMITS = Path(__file__).with_name("limits.txt").read_text(encoding="utf-8")


@pytest.mark.parametrize("requirement", requirements(LIMITS))
def test_paper(drive, requirement: Requirement) -> None:
    drive.check(requirement)
