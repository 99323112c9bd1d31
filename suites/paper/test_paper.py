"""The eleven settings of Bench2Drive-Robust (Tab. 2 of the paper) as requirements, for the agent under test.

In two readings, each with its own limits: `paper`, its equations, which runs unless the other one is chosen, and
`released`, what its released code does. `conftest.py` says how one chooses. The limits are those of the agent's name:
`limits/tcp.txt` for `tcp` and `tcp:mode=ctrl`, `limits/others.txt` for an agent that has no file of its own.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from pytest_drive_robust import Requirement, requirements

LIMITS = Path(__file__).with_name("limits")


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    marker = metafunc.definition.get_closest_marker("drive_robust")
    assert marker is not None
    metafunc.parametrize("requirement", requirements(limits_of(metafunc.config, marker.kwargs["reading"])))


def limits_of(config: pytest.Config, reading: str) -> Path:
    """Return the file whose limits hold for the agent of this run."""
    results = config.getoption("drive_results") or config.getini("drive_results")
    agent = config.getoption("drive_agent") or config.getini("drive_agent") or ("" if results else "tcp")
    ending = "" if reading == "paper" else f"_{reading}"
    known = {path.stem: path for path in LIMITS.glob("*.txt")}
    return known.get(f"{agent.partition(':')[0]}{ending}") or known[f"others{ending}"]


@pytest.mark.drive_robust(reading="paper")
def test_paper_reading(drive, requirement: Requirement) -> None:
    drive.check(requirement)


@pytest.mark.drive_robust(reading="released")
def test_released_reading(drive, requirement: Requirement) -> None:
    drive.check(requirement)
