"""The estimate of the routes that a verdict will still read."""

from __future__ import annotations

import random

import pytest

from pytest_drive_robust.stats.evidence import LinearForms, degradation_forms, mean_forms
from pytest_drive_robust.stats.judges import EvidenceJudge, PointJudge, judge_by, read_until_decided
from pytest_drive_robust.stats.pace import likely_left

RULE = degradation_forms(0.30)


@pytest.mark.parametrize("kind", ["evidence", "list"])
@pytest.mark.parametrize("keeps", [0.95, 0.8, 0.2])
def test_how_many_routes_are_likely_left_is_never_absurd_and_soon_right(kind: str, keeps: float) -> None:
    draw = random.Random(3)
    clean = draw.choices([100.0, 100.0, 60.0, 20.0], k=60)
    scores = [(before * draw.choice([1.0, keeps, keeps * draw.random()]), before) for before in clean]
    _, taken = read_until_decided(judge_by(kind, RULE, planned=60), scores)
    judge = judge_by(kind, RULE, planned=60)
    for number, (score, reference) in enumerate(scores[:taken]):
        left = likely_left(judge, 60)
        assert 1 <= left <= 60 - number
        if number >= taken // 2:
            assert number + left <= 2 * taken
        judge.read(score, reference)
    assert likely_left(judge, 60) == 0


def test_a_comparison_of_all_values_reads_all_routes() -> None:
    judge = PointJudge(RULE)
    assert likely_left(judge, 60) == 60
    judge.read(90.0, 90.0)
    assert likely_left(judge, 60) == 59


def test_a_metric_without_a_lower_end_has_no_early_pass_to_wait_for() -> None:
    forms = mean_forms(60.0, "<=", margin=10.0, low=0.0)  # efficiency
    assert likely_left(judge_by("evidence", forms, planned=60), 60) == 60


@pytest.mark.parametrize("limit", [-0.05, -0.10, -0.15])
def test_how_many_routes_a_limit_takes_that_scores_hardly_reach_is_all_of_them(limit: float) -> None:
    assert likely_left(judge_by("evidence", degradation_forms(limit), planned=60), 60) == 60


@pytest.mark.parametrize(
    ("forms", "usual"),
    [
        (degradation_forms(0.3), (85.0 * 0.9, 85.0)),
        (mean_forms(50.0, ">=", margin=10.0, low=0.0, high=100.0), (70.0, 0.0)),
        (mean_forms(0.5, ">=", margin=0.1, low=0.0, high=1.0), (0.7, 0.0)),
        (mean_forms(60.0, "<=", margin=10.0, low=0.0, high=100.0), (40.0, 0.0)),
    ],
    ids=["RD", "DS", "SR", "at most"],
)
def test_before_the_first_route_as_many_are_likely_left_as_scores_a_fifth_off_the_limit_take(
    forms: LinearForms, usual: tuple[float, float]
) -> None:
    expected = likely_left(judge_by("evidence", forms, planned=220), 220)
    judge = judge_by("evidence", forms, planned=220)
    while judge.read(*usual) is None:
        pass
    assert expected == pytest.approx(judge.routes, abs=1)


def test_how_many_routes_are_likely_left_counts_those_that_the_floor_takes() -> None:
    plain, waiting = EvidenceJudge(RULE), EvidenceJudge(RULE, floor=30.0)
    for _ in range(10):
        plain.read(32.0, 32.0)
        waiting.read(32.0, 32.0)
    assert likely_left(plain, 220) < likely_left(waiting, 220) <= 210


def test_references_that_are_shown_to_lie_above_the_floor_take_no_more_routes() -> None:
    plain, waiting = EvidenceJudge(RULE), EvidenceJudge(RULE, floor=30.0)
    for _ in range(6):
        plain.read(90.0, 90.0)
        waiting.read(90.0, 90.0)
    assert 0 < likely_left(waiting, 220) == likely_left(plain, 220)


@pytest.mark.parametrize(
    "forms",
    [degradation_forms(0.30, comparison=">="), mean_forms(60.0, ">=", margin=10.0, low=0.0)],
    ids=["lower-limit", "no-upper-end"],
)
def test_how_many_routes_are_likely_left_is_told_for_limits_of_every_kind(forms: LinearForms) -> None:
    assert 5 < likely_left(judge_by("evidence", forms, planned=60), 60) < 40
