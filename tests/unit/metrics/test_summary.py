from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from result_factory import crashed_simulation, make_result, scored, trace_of

from pytest_drive_robust.domain.outcome import End, InfractionKind
from pytest_drive_robust.errors import ComparisonError, UnknownNameError
from pytest_drive_robust.metrics.summary import summarize


def mixed_results() -> list:
    return [
        make_result("1", speed_ratios_pct=[100.0, 200.0]),
        make_result("2", infractions=[InfractionKind.RED_LIGHT], speed_ratios_pct=[90.0]),
        make_result("3", completion_pct=20.0, end=End.TICK_CAP, speed_ratios_pct=[], trace=trace_of(40)),
        make_result("4", completion_pct=10.0, end=End.AGENT_CRASHED, speed_ratios_pct=[], trace=trace_of(1)),
    ]


def test_the_official_numbers_of_four_episodes_by_hand() -> None:
    summary = summarize(mixed_results())

    assert summary.ds == pytest.approx((100.0 + 70.0 + 20.0 + 10.0) / 4)
    assert summary.sr == 0.25
    assert summary.efficiency == pytest.approx((150.0 + 90.0) / 2)  # routes without a checkpoint are left out
    assert summary.comfort == 100.0  # standing counts as comfortable
    assert summary.abilities["Overtaking"] == 0.25
    assert summary.mean_ability == 0.25
    assert (summary.episodes, summary.agent_errors) == (4, 1)


def test_the_fixed_numbers_of_four_episodes_by_hand() -> None:
    summary = summarize(mixed_results(), mode="fixed")

    assert summary.efficiency == pytest.approx((150.0 + 90.0 + 0.0 + 0.0) / 4)
    assert summary.comfort == 100.0
    assert summary.ds == 50.0
    assert summarize([make_result(trace=trace_of(40))], mode="fixed").comfort is None  # it stood


def test_no_data_is_none_and_not_0() -> None:
    summary = summarize([make_result(speed_ratios_pct=[], trace=trace_of(1))])

    assert summary.efficiency is None
    assert summary.comfort is None
    assert summary.abilities["Merging"] is None


def test_the_seeds_of_a_route_are_averaged_before_the_routes() -> None:
    summary = summarize([scored("1", 100.0, seed=0), scored("1", 50.0, seed=1), scored("2", 25.0, seed=0)])

    assert summary.ds == (75.0 + 25.0) / 2
    assert summary.sr == 0.25


def test_no_episode_an_infra_error_and_an_unknown_mode_are_refused() -> None:
    with pytest.raises(ComparisonError, match="no episode"):
        summarize([])
    with pytest.raises(ComparisonError, match=r"2 of 3 episodes.* first: driver on 2 "):
        summarize([make_result(), crashed_simulation("2"), crashed_simulation("3")])
    with pytest.raises(UnknownNameError, match="bench2drive"):
        summarize([make_result()], mode="bench2driv")


@given(st.permutations(range(4)), st.sampled_from(["bench2drive", "fixed"]))
def test_the_order_of_the_episodes_does_not_matter(order: list[int], mode: str) -> None:
    results = mixed_results()

    assert summarize([results[index] for index in order], mode=mode) == summarize(results, mode=mode)
