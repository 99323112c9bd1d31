"""The embedded bench, a real agent, and the same agent 100 ms slower: who is red, and does the named route show it?"""

from __future__ import annotations

import functools

import pytest
from late_agent import STUCK_STOP_S, LateAgent, snapshot_of_results

from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.perturbations.base import Setting
from pytest_drive_robust.registry.registry import default_registry
from pytest_drive_robust.regression.comparison import compare
from pytest_drive_robust.regression.snapshot import Snapshot
from pytest_drive_robust.report.comparison import comparison_text
from pytest_drive_robust.runner.episode.loop import drive_episode
from pytest_drive_robust.simulators.base import SimulatorOptions
from pytest_drive_robust.simulators.routes import resolve_routes
from pytest_drive_robust.verdict.explain import describe_outcome

pytestmark = pytest.mark.slow
pytest.importorskip("drive_robust_agents")

ROUTES, LATE = "201,401,601", "300 ms latency"


@functools.cache
def drive(*, late_ms: int = 0, only: str = "") -> tuple[EpisodeResult, ...]:
    registry = default_registry()
    simulator = registry.simulator("embedded", SimulatorOptions(stuck_stop_s=STUCK_STOP_S))
    agent = LateAgent(registry.agent("expert"), late_ms)
    return tuple(
        drive_episode(simulator, agent, route=route, setting=Setting.parse(setting), seed=0, agent_name="expert")
        for setting in ("clean", LATE)
        for route in resolve_routes(ROUTES)
        if not only or only == route.id
    )


def run_of(late_ms: int = 0) -> Snapshot:
    return snapshot_of_results(drive(late_ms=late_ms), spec=ROUTES, label=f"+{late_ms} ms")


def test_100_ms_more_turn_the_setting_red_that_they_break_and_no_other() -> None:
    comparison = compare(run_of(), run_of(100))
    assert {cell.setting: cell.verdict for cell in comparison.cells} == {"clean": "pass", LATE: "fail"}
    worst = comparison.regressions[0].flips[0]
    assert worst.fails
    assert f"newly going wrong: {worst.after.route_id} " in comparison_text(comparison, colour=False)


def test_the_route_that_the_message_names_shows_it_again() -> None:
    (regression,) = compare(run_of(), run_of(100)).regressions
    named = regression.flips[0].after
    again = drive(late_ms=100, only=named.route_id)[-1]
    assert describe_outcome(again) == named.outcome
    assert named.outcome.startswith("hit van (")


def test_the_unchanged_agent_repeats_bit_for_bit() -> None:
    first = drive()[0]
    again = drive(only=first.episode.route_id)[0]
    assert again.trace.digest == first.trace.digest
