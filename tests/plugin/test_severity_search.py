"""`drive.largest` and margins as people use them."""

from __future__ import annotations

import json

import jsonschema
import pytest
from published_schema import run_schema
from suite_runs import run

SEARCH = """
from pytest_drive_robust import InferenceLatency
from pytest_drive_robust.registry.registry import default_registry

def test_search(drive):
    throttle = default_registry().perturbations()["throttle"]
    found = drive.largest(throttle, metric="RD", limit=0.30, levels=[0.9, 0.7, 0.5, 0.3, 0.1])
    print(found)
    assert found.rule == "point"
    assert found >= throttle(share=0.7)
    assert found < throttle(share=0.3)
    assert drive.largest(throttle, metric="SR", limit=0.9).comparison == ">="
    assert drive.largest(InferenceLatency, limit=0.9).breaks is None
    assert drive.largest(InferenceLatency) >= InferenceLatency(ms=1000)
"""
LADDER = """
from typing import ClassVar
Throttle.ladder = ("share", (0.9, 0.7, 0.5, 0.3, 0.1))
"""


def test_the_largest_severity_that_holds_is_a_bracket_that_compares(suite, driven):
    folder = suite(test=SEARCH, conftest=LADDER)
    result = run(folder, "-s", "--drive-json", "run.json")
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines(
        [
            "RD <= 0.30 under throttle: holds at 0.*, breaks at 0.* (point rule on 3 routes, too few to show more)",
            "E * assert RD <= 0.30 under latency: *",
        ]
    )
    assert driven(), "episodes of the search are episodes of the run"
    document = json.loads((folder.path / "run.json").read_text())
    jsonschema.validate(document, run_schema())
    first = document["searches"][0]
    assert (first["failure"], first["metric"], first["rule"], first["holds"]) == ("throttle", "RD", "point", 0.7)
    assert first["breaks"] == 0.5
    result.stdout.fnmatch_lines(["steady: RD <= 0.30 under throttle: holds at 0.7, breaks at 0.5 *"])


SLOW_BUS = """

from collections import deque


@dataclass
class SlowBus(Perturbation):
    ticks: int = 2
    phrase = "slow bus {ticks}"
    ladder = ("ticks", (1, 2, 4))

    def reset(self, context):
        self._waiting = deque([Control()] * self.ticks)

    def actuate(self, tick, control, inference_s):
        self._waiting.append(control or Control())
        return self._waiting.popleft()


_register = pytest_drive_robust_register


def pytest_drive_robust_register(registry):
    _register(registry)
    registry.register_perturbation(SlowBus)
"""
SEARCH_SLOW_BUS = """
from pytest_drive_robust.registry.registry import default_registry

def test_search(drive):
    assert drive.largest(default_registry().perturbations()["slow-bus"], limit=0.9).holds == 4
"""


@pytest.mark.parametrize("executor", ["inline", "processes"])
def test_a_severity_of_whole_numbers_is_searched_for_in_whole_numbers(suite, executor):
    suite_ = suite("slow bus margin >= 4 (RD <= 0.90)", test=SEARCH_SLOW_BUS, conftest=SLOW_BUS)
    run(suite_, "--drive-executor", executor).assert_outcomes(passed=2)


def test_a_margin_that_is_not_met_says_how_far_the_agent_gets(suite):
    suite_ = suite("throttle margin >= 0.9 (RD <= 0.30)", "throttle margin >= 0.1 (RD <= 0.30)", conftest=LADDER)
    result = run(suite_, "--drive-verdict", "point")
    result.assert_outcomes(passed=1, failed=1)
    result.stdout.fnmatch_lines(
        [
            "RD under throttle 0.1 = *",
            "  RD <= 0.30 under throttle: holds at 0.*, breaks at 0.* (point rule on 3 routes*",
        ]
    )


def test_a_margin_of_a_users_metric_is_searched_for_as_it_was_asked_for(suite):
    metric = """

def bumps(results):
    return 1.0 if results[0].episode.setting == "throttle 0.1" else 0.0


_register = pytest_drive_robust_register


def pytest_drive_robust_register(registry):
    _register(registry)
    registry.register_metric("bumps", bumps)
"""
    result = run(suite("throttle margin >= 0.1 (bumps <= 0.5)", conftest=LADDER + metric), "--drive-verdict", "point")
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines(
        ["bumps under throttle 0.1 = *", "  bumps <= 0.5 under throttle: holds at *, breaks at 0.1*"]
    )


def test_a_severity_that_stays_open_for_another_reason_than_few_routes_says_so(suite):
    lazy = "\nclass Lazy(ScriptedAgent):\n    def __init__(self):\n        super().__init__([Control(throttle=0.1)])\n"
    test = """
def test_search(drive):
    from pytest_drive_robust.registry.registry import default_registry
    assert drive.largest(default_registry().perturbations()["throttle"], limit=0.5, levels=[0.9]).holds == 0.9
"""
    folder = suite(test=test, conftest=LADDER + lazy)
    result = run(folder, "--drive-agent", "conftest:Lazy")
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines(
        ["*undecided at 0.9: the clean driving score is *, below the floor of 30: RD says nothing yet*"]
    )


def test_episodes_that_the_run_has_are_not_driven_again(suite):
    test = """
def test_twice(drive):
    from pytest_drive_robust.registry.registry import default_registry
    throttle = default_registry().perturbations()["throttle"]
    assert str(drive.largest(throttle)) == str(drive.largest(throttle))
    for probe in drive.largest(throttle).probes:
        drive.rd(throttle(share=probe.level))
"""
    folder = suite(test=test, conftest=LADDER)
    run(folder).assert_outcomes(passed=1)
    once = (folder.path / "driven.log").read_text().splitlines()
    assert len(once) == 3 * (1 + 3)  # clean and the three severities of the bisection


def test_a_severity_that_changes_nothing_ends_the_search_as_an_error(suite):
    test = """
def test_blind(drive):
    from pytest_drive_robust import PartialObservation
    drive.largest(PartialObservation)
"""
    result = run(suite(test=test))
    result.assert_outcomes(errors=1)
    result.stdout.fnmatch_lines(["ERROR: not judged: the largest severity *", "*the agent has no camera*"])


def test_two_workers_find_the_same_bracket(suite):
    folder = suite(test=SEARCH, conftest=LADDER)
    found = []
    for workers in ((), ("-n2",)):
        run(folder, "--drive-json", "run.json", *workers)
        found.append(json.loads((folder.path / "run.json").read_text())["searches"])
    alone, shared = found
    assert alone
    assert sorted(shared, key=str) == sorted(alone, key=str)


def test_a_margin_that_is_not_met_fails_also_where_its_search_cannot_be_finished(suite):
    run(suite("RD under throttle 0.1 <= 0.99", conftest=LADDER), "--drive-verdict", "point")
    folder = suite("throttle margin >= 0.1 (RD <= 0.30)", conftest=LADDER)
    result = run(folder, "--drive-verdict", "point", "--drive-budget", "0.001s")
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines(
        [
            "RD under throttle 0.1 = *",
            "  the largest severity that holds is not known: the budget of 0.001 s is used up *",
        ]
    )


def test_a_margin_that_stays_open_is_not_searched_for(suite, driven):
    slow = "\nclass Slow(ScriptedAgent):\n    def __init__(self):\n        super().__init__([Control(throttle=0.1)])\n"
    folder = suite("throttle margin >= 0.9 (RD <= 0.30)", conftest=LADDER + slow)
    result = run(folder, "--drive-agent", "conftest:Slow", "--drive-verdict", "point")
    result.stdout.fnmatch_lines(["*inconclusive*"])
    assert len(driven()) == 3 * 2
