from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from result_factory import crashed_simulation, infraction, make_result

from pytest_drive_robust.domain.outcome import End, InfractionKind, Outcome
from pytest_drive_robust.errors import ComparisonError
from pytest_drive_robust.metrics.score import driving_score, is_success

PUNISHED = {
    InfractionKind.COLLISION_PEDESTRIAN: 0.5,
    InfractionKind.COLLISION_VEHICLE: 0.6,
    InfractionKind.COLLISION_LAYOUT: 0.65,
    InfractionKind.RED_LIGHT: 0.7,
    InfractionKind.STOP_SIGN: 0.8,
    InfractionKind.SCENARIO_TIMEOUT: 0.7,
    InfractionKind.YIELD_EMERGENCY: 0.7,
}
FREE = (
    InfractionKind.MIN_SPEED,
    InfractionKind.DEVIATION,
    InfractionKind.BLOCKED,
    InfractionKind.ROUTE_TIMEOUT,
)
kinds = st.sampled_from([*PUNISHED, *FREE])
events = st.builds(
    lambda kind, share: infraction(kind, share_pct=share),
    st.sampled_from(InfractionKind),
    st.floats(0.0, 100.0),
)


@pytest.mark.parametrize(("kind", "factor"), PUNISHED.items())
def test_each_infraction_multiplies_the_score_by_its_official_factor(kind: InfractionKind, factor: float) -> None:
    assert driving_score(make_result(infractions=[kind])) == pytest.approx(100.0 * factor, abs=1e-9)


@pytest.mark.parametrize("kind", FREE)
def test_minimum_speed_and_the_ends_of_a_route_cost_nothing(kind: InfractionKind) -> None:
    assert driving_score(make_result(infractions=[kind])) == 100.0


def test_two_collisions_and_a_red_light_on_eighty_percent_of_the_route() -> None:
    # 80 * 0.6 * 0.6 * 0.7
    result = make_result(
        completion_pct=80.0,
        end=End.TICK_CAP,
        infractions=[InfractionKind.COLLISION_VEHICLE, InfractionKind.COLLISION_VEHICLE, InfractionKind.RED_LIGHT],
    )

    assert driving_score(result) == 20.16


def test_leaving_the_lanes_costs_its_share_of_the_travelled_route() -> None:
    event = infraction(InfractionKind.OUTSIDE_LANES, share_pct=12.5)

    assert driving_score(make_result(infractions=[event], completion_pct=80.0)) == 70.0


@pytest.mark.parametrize("share_pct", [100.0, 104.0])
def test_who_is_outside_the_lanes_all_the_way_scores_0_and_never_less(share_pct: float) -> None:
    event = infraction(InfractionKind.OUTSIDE_LANES, share_pct=share_pct)

    assert driving_score(make_result(infractions=[event])) == 0.0


def test_the_score_is_rounded_to_six_digits_like_the_official_records() -> None:
    assert driving_score(make_result(completion_pct=33.333333333)) == 33.333333


def test_an_agent_that_crashed_is_scored_for_what_it_drove_and_is_no_success() -> None:
    result = make_result(end=End.AGENT_CRASHED, completion_pct=50.0, infractions=[InfractionKind.COLLISION_LAYOUT])

    assert driving_score(result) == 32.5
    assert not is_success(result)


def test_a_completed_route_with_slow_driving_only_is_a_success() -> None:
    assert is_success(make_result(infractions=[InfractionKind.MIN_SPEED]))


@pytest.mark.parametrize("kind", [kind for kind in InfractionKind if kind is not InfractionKind.MIN_SPEED])
def test_any_other_infraction_prevents_success(kind: InfractionKind) -> None:
    assert not is_success(make_result(infractions=[kind]))


@pytest.mark.parametrize("end", [end for end in End if end not in (End.COMPLETED, End.SIMULATION_CRASHED)])
def test_a_route_that_was_not_completed_is_no_success(end: End) -> None:
    assert not is_success(make_result(end=end))


@pytest.mark.parametrize(("outcome", "end"), [(Outcome.FAILED, End.COMPLETED), (Outcome.COMPLETED, End.ENVIRONMENT)])
def test_success_takes_both_the_outcome_and_the_end_of_the_route(outcome: Outcome, end: End) -> None:
    assert not is_success(make_result(outcome=outcome, end=end))


@pytest.mark.parametrize("score", [driving_score, is_success])
def test_an_infra_error_is_never_scored(score: object) -> None:
    with pytest.raises(ComparisonError, match=r"infra_error.*the server went away"):
        score(crashed_simulation())  # type: ignore[operator]


@given(st.lists(events, max_size=6), st.floats(0.0, 100.0))
def test_the_score_stays_between_0_and_100(infractions: list, completion_pct: float) -> None:
    assert 0.0 <= driving_score(make_result(infractions=infractions, completion_pct=completion_pct)) <= 100.0


@given(st.lists(events, max_size=5), events)
def test_one_more_infraction_never_raises_the_score(infractions: list, one_more: object) -> None:
    before = driving_score(make_result(infractions=infractions))

    assert driving_score(make_result(infractions=[*infractions, one_more])) <= before  # type: ignore[list-item]


@given(st.permutations([*PUNISHED, *FREE]))
def test_the_order_of_the_infractions_does_not_matter(order: list[InfractionKind]) -> None:
    assert driving_score(make_result(infractions=order)) == driving_score(make_result(infractions=[*PUNISHED, *FREE]))
