from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pytest_drive_robust.stats import gate
from pytest_drive_robust.stats.resolution import (
    advise,
    resolution,
    routes_needed,
    told_apart,
)


def test_the_formula_by_hand() -> None:
    # z(0.96) + z(0.90) = 1.7507 + 1.2816 standard errors
    assert resolution(220, 0.45) == pytest.approx(3.0322 * 0.45 / math.sqrt(220), rel=1e-4)
    assert routes_needed(0.10, 0.45) == math.ceil((3.0322 * 4.5) ** 2)


@given(st.floats(0.03, 0.3), st.floats(0.1, 1.0), st.sampled_from([0.01, 0.05]))
def test_as_many_routes_as_needed_resolve_the_margin_and_one_less_does_not(
    margin: float, noise: float, alpha: float
) -> None:
    needed = routes_needed(margin, noise, alpha=alpha)

    assert needed >= 20
    assert resolution(needed, noise, alpha=alpha) <= margin + 1e-9
    if needed > 21:
        assert resolution(needed - 1, noise, alpha=alpha) > margin - 1e-9


@given(st.integers(1, 400))
def test_more_routes_resolve_more(routes: int) -> None:
    assert resolution(routes + 1) < resolution(routes)


def test_fewer_than_20_routes_catch_next_to_nothing() -> None:
    # Betting alone: 19 pairs that all lose the same must multiply 1 by 300 with a stake of 0.9
    assert resolution(19) == pytest.approx(2.0 * (300.0 ** (1.0 / 19.0) - 1.0) / 0.9)
    assert told_apart(20) < 0.31 < resolution(20) < 0.37 < 0.75 < resolution(19)
    assert resolution(10, 30.0, scale=100.0) > 100.0
    assert advise(10, 0.30).text == (
        "10 routes show that a limit is broken in no case; the margin of 0.30 takes about 30 routes. "
        "Give more routes or a wider margin, or expect inconclusive verdicts"
    )


def test_three_pairs_that_lose_everything_are_below_the_resolution_and_not_failed() -> None:
    assert resolution(3) > 1.0
    assert gate([100.0] * 3, [0.0] * 3, 0.30).verdict == "inconclusive"
    assert gate([50.0] * 19, [15.0] * 19, 0.30).verdict == "inconclusive"
    assert gate([50.0] * 20, [15.0] * 20, 0.30).verdict == "fail"


def test_no_routes_and_no_margin_are_refused() -> None:
    with pytest.raises(ValueError, match="1 or more"):
        resolution(0)
    with pytest.raises(ValueError, match="above 0"):
        routes_needed(0.0)


def test_a_margin_finer_than_the_resolution_is_warned_about_in_words() -> None:
    advice = advise(50, 0.10)

    assert advice.level == "warn"
    assert advice.text == (
        "50 routes show that a limit is broken where RD misses it by 0.19 or more (90% of the time); "
        "the margin of 0.10 takes about 190 routes. Give more routes or a wider margin, or expect inconclusive verdicts"
    )


def test_many_routes_are_fine_few_are_warned_about_and_very_few_are_refused() -> None:
    assert advise(220, 0.10).level == "fine"
    assert advise(220, 0.10).text == ""
    assert advise(120, 0.10, noise=0.33).level == "fine"
    assert advise(44, 0.25).level == "warn"
    assert "50 are better" in advise(44, 0.25).text
    assert advise(19, 0.10).level == "refuse"
    assert "Give 20 routes or more, or a margin of 0.3 or more" in advise(19, 0.10).text
    assert advise(19, 0.30).level == "warn"
    assert advise(10, 10.0, 30.0, what="DS", scale=100.0).level == "refuse"
    assert "margin of 30 or more" in advise(10, 10.0, 30.0, what="DS", scale=100.0).text


@pytest.mark.parametrize("routes", [3, 19, 20, 30, 44, 220])
@pytest.mark.parametrize("noise", [0.05, 0.45])
def test_what_routes_show_of_ds_is_a_hundred_times_what_they_show_of_sr(routes: int, noise: float) -> None:
    assert resolution(routes, 100.0 * noise, scale=100.0) == pytest.approx(100.0 * resolution(routes, noise))
    assert routes_needed(25.0, 100.0 * noise, scale=100.0) == routes_needed(0.25, noise)
    small, large = advise(routes, 0.25, noise), advise(routes, 25.0, 100.0 * noise, scale=100.0)
    assert small.level == large.level
    assert ("in no case" in small.text) is ("in no case" in large.text)


@pytest.mark.parametrize("routes", [20, 30, 44])
def test_without_noise_a_violation_must_outweigh_the_routes_that_nobody_drew(routes: int) -> None:
    # None of so many routes of a share s is with a chance of exp(-s * routes); each of them may score twice the mean
    assert resolution(routes, 1e-9) == pytest.approx(2.0 * -math.log(0.05) / routes, rel=0.05)


def test_the_advice_counts_the_routes_for_its_own_alpha() -> None:
    assert routes_needed(0.10, alpha=0.01) > routes_needed(0.10) + 50
    wanted = math.ceil(routes_needed(0.10, alpha=0.01) / 10) * 10
    assert f"takes about {wanted} routes" in advise(50, 0.10, alpha=0.01).text


def test_fifty_routes_are_not_few() -> None:
    assert [advise(routes, 0.35).level for routes in (49, 50)] == ["warn", "fine"]
