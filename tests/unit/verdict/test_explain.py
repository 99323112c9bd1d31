from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from result_factory import infraction, make_result, scored, trace_of

from pytest_drive_robust.domain.outcome import End, InfractionKind
from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.verdict.explain import (
    WorstRoute,
    describe_outcome,
    first_divergence,
    seconds_text,
    worst_routes,
)


def parted_s(clean: EpisodeResult, perturbed: EpisodeResult) -> float | None:
    found = first_divergence(clean, perturbed)
    return None if found is None else found.second


def test_a_clean_drive_is_completed() -> None:
    assert describe_outcome(make_result(infractions=[InfractionKind.MIN_SPEED])) == "completed"


def test_a_completed_route_names_its_first_infraction() -> None:
    light = infraction(InfractionKind.RED_LIGHT, second=8.2)

    assert describe_outcome(make_result(infractions=[light])) == "completed, red light at 8.2 s"


def test_the_first_infraction_is_the_earliest_and_the_others_are_counted() -> None:
    result = make_result(
        end=End.BLOCKED,
        trace=trace_of(1220),
        infractions=[
            infraction(InfractionKind.BLOCKED, second=61.0),
            infraction(InfractionKind.COLLISION_LAYOUT, second=12.0),
            infraction(InfractionKind.COLLISION_VEHICLE, second=11.3),
        ],
    )

    assert describe_outcome(result) == "collision with vehicle at 11.3 s and 1 more, blocked at 61.0 s"


def test_a_collision_says_what_was_hit_and_how_fast() -> None:
    van = replace(infraction(InfractionKind.COLLISION_VEHICLE, second=11.3), detail="hit van at 9.3 m/s")
    found = make_result(end=End.BLOCKED, trace=trace_of(1220), infractions=[van])

    assert describe_outcome(found) == "hit van (33 km/h) at 11.3 s, blocked at 61.0 s"
    official = replace(van, detail="Agent collided against object with type=vehicle.tesla.model3 at (x=1)")
    found = make_result(end=End.BLOCKED, trace=trace_of(1220), infractions=[official])

    assert describe_outcome(found) == "collision with vehicle at 11.3 s, blocked at 61.0 s"


def test_an_infraction_of_which_nobody_told_when_has_no_second() -> None:
    result = make_result(end=End.BLOCKED, infractions=[infraction(InfractionKind.COLLISION_VEHICLE, second=0.0)])

    assert describe_outcome(result).startswith("collision with vehicle, blocked at ")


def test_an_infraction_of_the_first_tick_has_its_second() -> None:
    result = make_result(infractions=[infraction(InfractionKind.COLLISION_VEHICLE, second=0.05)])

    assert describe_outcome(result) == "completed, collision with vehicle at 0.1 s"


def test_a_second_is_rounded_up_at_the_half_although_rounding_put_it_below() -> None:
    assert seconds_text(7.25) == seconds_text(7.25 - 1e-9) == "7.3 s"


def test_leaving_the_lanes_is_told_by_its_share() -> None:
    event = infraction(InfractionKind.OUTSIDE_LANES, share_pct=12.4)

    assert describe_outcome(make_result(infractions=[event])) == "completed, outside the lanes for 12 % of the way"


def test_an_agent_error_says_what_was_raised() -> None:
    result = make_result(end=End.AGENT_CRASHED, end_detail="ValueError: steer is nan", trace=trace_of(64))

    assert describe_outcome(result) == "agent error at 3.2 s (ValueError: steer is nan)"


@pytest.mark.parametrize("end", End)
@pytest.mark.parametrize("kind", InfractionKind)
def test_every_end_and_every_infraction_can_be_told(end: End, kind: InfractionKind) -> None:
    assert describe_outcome(make_result(end=end, infractions=[kind]))


def drive(ticks: int = 100, **columns: object) -> EpisodeResult:
    return make_result(trace=trace_of(ticks, **columns))


def from_tick(tick: int, value: float, ticks: int = 100) -> np.ndarray:
    values = np.zeros(ticks)
    values[tick:] = value
    return values


def test_identical_episodes_never_diverge() -> None:
    assert parted_s(drive(), drive()) is None


@pytest.mark.parametrize(
    ("column", "small", "large"),
    [("x_m", 0.5, 0.51), ("y_m", -0.5, -0.51), ("speed_mps", 1.0, 1.01)],
)
def test_the_first_tick_that_is_too_far_away_counts(column: str, small: float, large: float) -> None:
    assert parted_s(drive(), drive(**{column: from_tick(30, small)})) is None
    assert parted_s(drive(), drive(**{column: from_tick(30, large)})) == pytest.approx(31 * 0.05)


def test_distance_is_measured_ahead_and_beside_the_clean_ego() -> None:
    # 0.45 m east and 0.45 m south: 0.64 m straight ahead of an ego that heads south-east.
    moved = {"x_m": from_tick(10, 0.45), "y_m": from_tick(10, 0.45)}

    assert parted_s(drive(), drive(**moved)) is None
    assert parted_s(drive(yaw_rad=math.pi / 4), drive(yaw_rad=math.pi / 4, **moved)) == pytest.approx(0.55)


def test_only_common_ticks_are_compared() -> None:
    assert parted_s(drive(), drive(50)) is None
    assert parted_s(drive(20), drive(x_m=from_tick(30, 5.0))) is None
    assert parted_s(drive(), drive(0)) is None


@pytest.mark.parametrize(
    ("column", "change", "signal"),
    [("x_m", 0.6, "in distance"), ("y_m", 0.6, "sideways"), ("speed_mps", 1.2, "in speed")],
)
def test_what_left_its_tolerance_first_is_named(column: str, change: float, signal: str) -> None:
    found = first_divergence(drive(), drive(**{column: from_tick(30, change)}))
    assert found == (pytest.approx(31 * 0.05), signal)


LATE = "200 ms latency"


def test_relative_ranks_by_the_loss_against_the_twin() -> None:
    clean = [scored("1", 100.0), scored("2", 60.0), scored("3", 90.0), scored("4", 80.0), scored("5", 10.0)]
    late = [scored(route, score, setting=LATE) for route, score in zip("12345", (70, 0, 85, 79, 20), strict=True)]

    worst = worst_routes(clean, late, relative=True)

    assert [(route.route_id, route.clean_score, route.perturbed_score) for route in worst] == [
        ("2", 60.0, 0.0),
        ("1", 100.0, 70.0),
        ("3", 90.0, 85.0),
    ]


def test_absolute_ranks_by_the_lowest_score_and_leaves_full_scores_out() -> None:
    worst = worst_routes([], [scored("1", 100.0), scored("2", 40.0), scored("3", 20.0)], relative=False)

    assert [route.route_id for route in worst] == ["3", "2"]
    assert worst[0].clean_score is None
    assert (worst[0].clean_outcome, worst[0].diverged_s) == ("not driven", None)


def test_a_route_appears_once_with_its_worst_seed_and_ties_go_by_route() -> None:
    results = [scored("2", 10.0), scored("1", 10.0, seed=3), scored("1", 50.0), scored("1", 10.0, seed=1)]

    assert [(route.route_id, route.seed) for route in worst_routes([], results, relative=False)] == [("1", 1), ("2", 0)]


def test_each_route_tells_both_outcomes_and_when_they_diverged() -> None:
    speed = np.zeros(1220)
    speed[99:] = 3.0
    clean = make_result("9", scenario="ParkingCutIn", trace=trace_of(300))
    perturbed = make_result(
        "9",
        scenario="ParkingCutIn",
        setting=LATE,
        end=End.BLOCKED,
        completion_pct=50.0,
        infractions=[infraction(InfractionKind.COLLISION_VEHICLE, second=11.3)],
        trace=trace_of(1220, speed_mps=speed),
    )

    assert worst_routes([clean], [perturbed], relative=True) == (
        WorstRoute(
            route_id="9",
            scenario="ParkingCutIn",
            seed=0,
            clean_score=100.0,
            perturbed_score=pytest.approx(30.0),
            clean_outcome="completed",
            perturbed_outcome="collision with vehicle at 11.3 s, blocked at 61.0 s",
            diverged_s=pytest.approx(5.0),
            diverged_by="in speed",
        ),
    )
