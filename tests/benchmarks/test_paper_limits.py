"""Limits that ship beside `suites/paper`: what the committed table says of the same drives meets each of them."""

from __future__ import annotations

import json
from pathlib import Path
from statistics import fmean

import pytest

from pytest_drive_robust import requirements
from pytest_drive_robust.perturbations.readings import READINGS, DriveReading
from pytest_drive_robust.simulators.embedded.routes import named_routes
from pytest_drive_robust.stats import gate

ROOT = Path(__file__).resolve().parents[2]
LIMITS = ROOT / "suites" / "paper" / "limits"
TABLE = json.loads((ROOT / "benchmarks" / "paper" / "results.json").read_text(encoding="utf-8"))


def scores(agent: str, setting: str) -> list[float]:
    """Return the driving scores on the routes that `suites/paper` drives, of seed 0."""
    judged = {route.id for route in named_routes("one-per-scenario")}
    driven = TABLE["agents"][agent]["settings"][setting]["driving_score"][TABLE["seeds"].index(0)]
    return [score for route, score in zip(TABLE["routes"], driven, strict=True) if route in judged]


@pytest.mark.parametrize("reading", READINGS)
@pytest.mark.parametrize("agent", TABLE["agents"])
def test_an_agent_meets_the_limits_of_its_name(agent: str, reading: str) -> None:
    stated = requirements(LIMITS / (f"{agent}.txt" if reading == "paper" else f"{agent}_{reading}.txt"))
    assert len(stated) == 12
    for requirement in stated:
        setting = requirement.setting.read_as(DriveReading(reading, "this test"))
        perturbed = scores(agent, str(setting))
        assert len(perturbed) == 44
        if requirement.metric.name == "DS":
            assert fmean(perturbed) >= requirement.limit + 10, requirement
        else:
            clean = scores(agent, str(setting.baseline))
            assert 1 - fmean(perturbed) / fmean(clean) <= requirement.limit, requirement
            assert gate(clean, perturbed, threshold=requirement.limit).verdict == "pass", requirement
