"""Limits that ship beside `suites/paper`: what the committed table says of the same drives meets each of them."""

from __future__ import annotations

import json
import re
from pathlib import Path
from statistics import fmean

import pytest

from pytest_drive_robust import requirements
from pytest_drive_robust.domain.verdict_rule import VerdictRule
from pytest_drive_robust.perturbations.readings import READINGS, DriveReading
from pytest_drive_robust.runner.planned_order import planned_order
from pytest_drive_robust.simulators.embedded.route_sets import named_routes
from pytest_drive_robust.stats import gate
from pytest_drive_robust.stats.judges import judge_by, read_until_decided

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


@pytest.mark.parametrize("agent", TABLE["agents"])
def test_a_file_says_how_many_routes_its_verdicts_take(agent: str) -> None:
    judged = {route.id: route.scenario.type for route in named_routes("one-per-scenario")}
    driven = [route for route in TABLE["routes"] if route in judged]
    order = [driven.index(route) for route in planned_order(driven, [judged[route] for route in driven], agent)]
    rule, taken = VerdictRule().for_routes(len(order)), []
    for requirement in requirements(LIMITS / f"{agent}.txt"):
        setting = requirement.setting.read_as(DriveReading("paper", "this test"))
        perturbed = scores(agent, str(setting))
        clean = scores(agent, str(setting.baseline)) if requirement.needs_clean else perturbed
        floor = rule.clean_floor if requirement.needs_clean else 0.0
        judge = judge_by(rule.kind, requirement.linear_forms(rule), planned=len(order), floor=floor)
        verdict, routes = read_until_decided(judge, [(perturbed[place], clean[place]) for place in order])
        assert verdict == "pass"
        taken.append(routes)
    said = re.search(r"takes (\d+) to (\d+) of the 44 routes", (LIMITS / f"{agent}.txt").read_text(encoding="utf-8"))
    assert said is not None
    assert (min(taken), max(taken)) == tuple(map(int, said.groups()))
