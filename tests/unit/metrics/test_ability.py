from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest
from result_factory import crashed_simulation, make_result

from pytest_drive_robust.domain.outcome import End, InfractionKind
from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.errors import ComparisonError
from pytest_drive_robust.metrics.ability import ABILITIES, abilities, mean_ability, signs_between
from pytest_drive_robust.metrics.summary import summarize
from pytest_drive_robust.simulators.embedded.route_sets import named_routes


def test_the_lists_have_the_sizes_of_the_official_tool() -> None:
    assert {name: len(types) for name, types in ABILITIES.items()} == {
        "Overtaking": 9,
        "Merging": 16,
        "Emergency_Brake": 12,
        "Give_Way": 2,
        "Traffic_Signs": 19,
    }
    everything = [scenario for types in ABILITIES.values() for scenario in types]
    assert len(set(everything)) == 44
    assert len(everything) - len(set(everything)) == 14


def test_the_lists_spell_the_types_as_routes_do() -> None:
    listed = {scenario for types in ABILITIES.values() for scenario in types}

    assert listed == {route.scenario.type for route in named_routes("one-per-scenario")}


def test_a_scenario_counts_in_every_ability_that_lists_it() -> None:
    rates = abilities(
        [
            make_result("1", scenario="PedestrianCrossing"),
            make_result("2", scenario="HardBreakRoute", end=End.BLOCKED),
            make_result("3", scenario="ParkedObstacle", end=End.BLOCKED),
        ]
    )

    assert rates == {
        "Overtaking": 0.0,
        "Merging": None,
        "Emergency_Brake": 0.5,
        "Give_Way": None,
        "Traffic_Signs": 1.0,
    }
    assert mean_ability(rates) == 0.5


def test_no_ability_has_data_for_an_unknown_scenario() -> None:
    rates = abilities([make_result(scenario="SomethingElse")])

    assert set(rates.values()) == {None}
    assert mean_ability(rates) is None


@pytest.mark.parametrize(
    ("junction_passed", "infractions", "rate"),
    [
        (True, [], 1.0),
        (True, [InfractionKind.COLLISION_VEHICLE], 1.0),
        (True, [InfractionKind.RED_LIGHT], 0.0),
        (True, [InfractionKind.STOP_SIGN], 0.0),
        (False, [], 0.0),
    ],
)
def test_signs_count_as_mastered_when_the_junction_was_passed_in_order(
    junction_passed: bool, infractions: list[InfractionKind], rate: float
) -> None:
    result = make_result(
        scenario="NonSignalizedJunctionRightTurn",
        end=End.TICK_CAP,
        junction_passed=junction_passed,
        infractions=infractions,
    )
    rates = abilities([result])

    assert rates["Traffic_Signs"] == rate
    assert rates["Merging"] == 0.0


def official(route: str, **given: Any) -> EpisodeResult:
    """What is read from a record of the official evaluator, which tells of no junction."""
    given = {"scenario": "NonSignalizedJunctionRightTurn", "end": End.TICK_CAP, "completion_pct": 40.0, **given}
    return replace(make_result(route, **given), versions={"bench2drive": "results"})


def test_signs_lie_between_bounds_where_records_tell_of_no_junction() -> None:
    failed, red = official("2"), official("3", infractions=[InfractionKind.RED_LIGHT])
    done, stood = official("1", end=End.COMPLETED, completion_pct=100.0), official("4", completion_pct=0.0)
    assert signs_between([done, failed, red, stood]) == (0.25, 0.5)
    assert abilities([done, failed, red, stood])["Traffic_Signs"] is None
    assert abilities([done, failed, red, stood])["Merging"] == 0.25
    assert summarize([done, failed]).mean_ability is None
    assert signs_between([done, red, stood]) is None
    assert abilities([done, red, stood])["Traffic_Signs"] == pytest.approx(1 / 3)
    assert summarize([done, red, stood]).mean_ability == pytest.approx(1 / 3)
    own = replace(failed, versions={})
    assert signs_between([done, own]) is None
    assert abilities([done, own])["Traffic_Signs"] == 0.5


def test_abilities_of_nothing_or_of_an_infra_error_are_refused() -> None:
    with pytest.raises(ComparisonError, match="no episode"):
        abilities([])
    with pytest.raises(ComparisonError, match="infra_error"):
        abilities([make_result(), crashed_simulation("2")])
