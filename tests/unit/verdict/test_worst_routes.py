from __future__ import annotations

import numpy as np
import pytest
from result_factory import infraction, make_result, scored, trace_of

from pytest_drive_robust.domain.outcome import End, InfractionKind
from pytest_drive_robust.verdict.worst import WorstRoute, worst_routes

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
