"""An unchanged agent is left in peace under fresh seeds, and one whose commands come later is not."""

from __future__ import annotations

import functools

import pytest
from parked_car_world import SETTINGS, Braker, drive_run

from pytest_drive_robust.regression.comparison import compare
from pytest_drive_robust.regression.comparison_result import Comparison
from pytest_drive_robust.regression.document import snapshot_of
from pytest_drive_robust.regression.snapshot import Snapshot
from pytest_drive_robust.report.comparison import comparison_text
from pytest_drive_robust.report.json_file import run_as_json

pytestmark = pytest.mark.slow

ROUTES = 40
FRESH_SEEDS = range(1, 21)
LATENCY = SETTINGS[1]


@functools.cache
def drive(seed: int, *, late_ticks: int = 0) -> Snapshot:
    run = drive_run(Braker(late_ticks=late_ticks), routes=ROUTES, seed=seed)
    return snapshot_of(run_as_json(run), label=f"seed {seed}")


def verdicts(comparison: Comparison) -> dict[str, str]:
    return {cell.setting: cell.verdict for cell in comparison.cells}


def test_an_unchanged_agent_alarms_0_of_20_times() -> None:
    stored = drive(0)
    assert len({drive(seed).cells["braker", LATENCY].routes["7"].ds for seed in FRESH_SEEDS}) > 1, "seeds must matter"
    found = [compare(stored, drive(seed)) for seed in FRESH_SEEDS]
    assert [len(comparison.regressions) for comparison in found] == [0] * 20
    passed = sum(verdicts(comparison)["clean"] == "pass" for comparison in found)
    assert passed == 20, "silence must not come from seeing nothing"


def test_100_ms_more_latency_alarms_on_the_right_setting_and_names_a_route_that_shows_it() -> None:
    comparison = compare(drive(0), drive(1, late_ticks=2))
    assert verdicts(comparison) == {"clean": "pass", LATENCY: "fail"}
    (regression,) = comparison.regressions
    worst = regression.flips[0]
    assert worst.fails
    assert worst.before.outcome == "completed"
    assert worst.after.outcome.startswith("hit a car (")
    text = comparison_text(comparison, colour=False)
    route = worst.after.route_id
    assert f'drive-robust replay {route} --agent braker --setting "200 ms latency" --seed 1' in text
    assert text.splitlines()[-1] == "REGRESSION: 1 of 2 settings against seed 0: braker under 200 ms latency"
