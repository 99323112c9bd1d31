"""The distance of proposed limits, over runs of any scores."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pytest_drive_robust.domain.verdict_rule import VerdictRule
from pytest_drive_robust.errors import UnknownNameError, UsageError
from pytest_drive_robust.perturbations import BUILTIN, Setting
from pytest_drive_robust.regression.fingerprint import Fingerprint
from pytest_drive_robust.regression.proposed_limits import ProposedLimit, propose_limits
from pytest_drive_robust.regression.snapshot import Cell, RouteScore, Snapshot, Taken
from pytest_drive_robust.runner.planned_order import planned_order
from pytest_drive_robust.stats.judges import judge_by, read_until_decided

RULE = VerdictRule()


def run(clean: list[float], perturbed: list[float], setting: str = "200 ms latency") -> Snapshot:
    cells = {}
    for name, scores in (("clean", clean), (setting, perturbed)):
        routes = {
            str(n): RouteScore.of(
                str(n), "Accident", [Taken(0, ds, ds == 100.0, "")], digest="", fingerprint=Fingerprint("embedded")
            )
            for n, ds in enumerate(scores)
        }
        cells["driver", name] = Cell("driver", name, "full", routes)
    return Snapshot("run", cells)


def limits(snapshot: Snapshot, agent: str = "driver") -> tuple[ProposedLimit, ...]:
    return propose_limits(snapshot, agent, perturbations=BUILTIN, rule=RULE)


scores = st.floats(1.0, 100.0)


@given(st.lists(st.tuples(st.floats(40.0, 100.0), scores), min_size=2, max_size=60))
def test_the_agent_meets_what_is_proposed(pairs: list[tuple[float, float]]) -> None:
    for item in limits(run([clean for clean, _ in pairs], [score for _, score in pairs])):
        assert item.requirement.is_met_by(round(item.value, 9))
        assert item.spare >= -1e-9


@pytest.mark.parametrize("routes", [20, 30, 44, 100])
@pytest.mark.parametrize("lost", [0, 1, 2, 5])
@pytest.mark.parametrize("first", [True, False])
def test_the_scores_that_a_limit_rests_on_pass_it_in_the_order_of_a_run(routes: int, lost: int, first: bool) -> None:
    clean = [100.0 if n % 4 else 60.0 for n in range(routes)]
    perturbed = [0.0 if (n if first else routes - 1 - n) < lost else score for n, score in enumerate(clean)]
    found = limits(run(clean, perturbed))
    assert len(found) == 2
    order = [int(route) for route in planned_order([str(n) for n in range(routes)], ["Accident"] * routes, "driver")]
    for item in found:
        scores = perturbed if item.requirement.needs_clean else clean
        judge = judge_by("evidence", item.requirement.linear_forms(RULE), planned=routes)
        assert read_until_decided(judge, [(scores[n], clean[n]) for n in order])[0] == "pass", item


def test_a_run_that_is_not_whole_gives_none() -> None:
    whole = run([100.0] * 5, [90.0] * 5)
    cells = {
        key: replace(cell, broken=("3, seed 0: no map",)) if "ms" in key[1] else cell
        for key, cell in whole.cells.items()
    }
    with pytest.raises(
        UsageError, match="the run 'run' is incomplete: driver under 200 ms latency on 3, seed 0: no map"
    ):
        limits(replace(whole, cells=cells))


def test_a_run_that_stopped_at_its_verdicts_gives_none() -> None:
    whole = run([100.0] * 5, [90.0] * 5)
    cells = {key: replace(cell, stopped=("5 of 44 routes of all",)) for key, cell in whole.cells.items()}
    with pytest.raises(
        UsageError, match=r"clear, on 5 of 44 routes of all under clean, and 1 more.*--drive-verdict=point"
    ):
        limits(replace(whole, cells=cells))


def test_more_routes_allow_a_limit_nearer_to_the_value() -> None:
    clean, perturbed = [100.0, 40.0, 80.0, 60.0], [90.0, 20.0, 100.0, 10.0]
    few, many = (limits(run(clean * times, perturbed * times))[1] for times in (6, 50))
    assert few.value == pytest.approx(many.value)
    assert few.spare > many.spare + 0.05


@pytest.mark.parametrize("kept", [0.0, 5.0])
def test_a_setting_that_may_cost_everything_gets_no_limit(kept: float) -> None:
    assert [str(item.requirement) for item in limits(run([100.0] * 5, [kept] * 5))] == ["DS under clean >= 95"]


@pytest.mark.parametrize(
    ("clean", "perturbed", "expected"),
    [
        (
            [97.0] * 5,
            [67.9] * 5,
            ["DS under clean >= 90", "RD under 200 ms latency <= 0.35"],
        ),  # 0.3 is 0.30000000000000004
    ],
)
def test_a_limit_stands_a_step_from_the_value_of_few_routes_on_the_lenient_side(
    clean: list[float], perturbed: list[float], expected: list[str]
) -> None:
    assert [str(item.requirement) for item in limits(run(clean, perturbed))] == expected


def test_what_all_routes_lose_alike_takes_no_distance_and_a_score_counts_its_margin_in_points() -> None:
    clean = [100.0, 60.0] * 22
    found = limits(run(clean, [0.3 * score for score in clean]))
    assert [str(item.requirement) for item in found] == ["DS under clean >= 80", "RD under 200 ms latency <= 0.70"]
    varied = [100.0, 10.0] * 22
    assert limits(run(varied, [0.3 * score for score in varied]))[1].requirement.limit == 0.70


def test_what_a_setting_is_compared_with_gets_no_limit_of_its_own() -> None:
    setting = Setting.parse("200 ms latency (warmup_ticks=20)")
    whole = run([97.0] * 5, [67.9] * 5, str(setting))
    clean = whole.cells.pop(("driver", "clean"))
    whole.cells["driver", str(setting.baseline)] = replace(clean, setting=str(setting.baseline))
    assert [str(item.requirement) for item in limits(whole)] == [f"RD under {setting} <= 0.35"]


def test_an_agent_that_does_not_drive_gets_none() -> None:
    with pytest.raises(UsageError, match="shows no limit for 'driver'"):
        limits(run([5.0] * 30, [4.0] * 30))


def test_an_agent_that_was_not_driven_is_refused() -> None:
    with pytest.raises(UnknownNameError, match="Did you mean 'driver'"):
        limits(run([80.0] * 3, [70.0] * 3), "drive")
