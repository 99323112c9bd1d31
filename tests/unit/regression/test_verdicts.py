"""The verdict on one allowance."""

from __future__ import annotations

import pytest

from pytest_drive_robust.regression.allowance import parse_allowances
from pytest_drive_robust.regression.rises import Quartet
from pytest_drive_robust.regression.verdicts import judge_rise


def quartets(clean_before: float, clean_after: float, *, kept_before: float, kept_after: float) -> list[Quartet]:
    scores = (clean_before, clean_before * kept_before, clean_after, clean_after * kept_after)
    return [Quartet(str(number), *scores) for number in range(200)]


@pytest.mark.parametrize("kind", ["evidence", "list", "point"])
def test_a_rise_of_rd_never_passes_where_a_clean_score_is_below_the_floor(kind) -> None:
    (allowance,) = parse_allowances(["rd:+0.05"], source="test")

    def verdict(clean_before: float, clean_after: float, *, kept_after: float = 0.9) -> str:
        return judge_rise(
            quartets(clean_before, clean_after, kept_before=0.9, kept_after=kept_after), allowance, kind=kind
        )

    assert verdict(80.0, 80.0) == verdict(30.0, 30.0) == "pass"
    assert verdict(80.0, 29.0) == verdict(29.0, 80.0) == verdict(0.001, 0.001) == "inconclusive"
    assert verdict(80.0, 29.0, kept_after=0.2) == "fail"
    assert verdict(80.0, 0.0) == "inconclusive"
