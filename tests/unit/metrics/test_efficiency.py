from __future__ import annotations

import pytest
from result_factory import crashed_simulation, make_result

from pytest_drive_robust.errors import ComparisonError, UnknownNameError
from pytest_drive_robust.metrics.efficiency import efficiency


def test_efficiency_is_the_mean_of_the_checkpoints() -> None:
    assert efficiency(make_result(speed_ratios_pct=[50.0, 100.0, 180.0])) == 110.0


def test_the_official_tool_drops_values_above_a_thousand_and_keeps_a_thousand() -> None:
    result = make_result(speed_ratios_pct=[100.0, 1000.0, 1000.01, 5000.0])

    assert efficiency(result) == 550.0
    assert efficiency(result, mode="fixed") == pytest.approx(7100.01 / 4)


@pytest.mark.parametrize("ratios", [(), (2000.0,)])
def test_an_episode_without_a_usable_checkpoint_has_no_official_efficiency(ratios: tuple[float, ...]) -> None:
    assert efficiency(make_result(speed_ratios_pct=ratios)) is None


def test_a_stuck_episode_has_efficiency_0_when_fixed() -> None:
    assert efficiency(make_result(speed_ratios_pct=()), mode="fixed") == 0.0


def test_an_unknown_mode_is_refused_with_the_nearest_one() -> None:
    with pytest.raises(UnknownNameError, match="Did you mean 'fixed'"):
        efficiency(make_result(), mode="fix")


def test_an_infra_error_has_no_efficiency() -> None:
    with pytest.raises(ComparisonError, match="infra_error"):
        efficiency(crashed_simulation())
