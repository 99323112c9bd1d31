"""A value and its limit, side by side: what is printed agrees with the verdict."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pytest_drive_robust.report.numbers import beside, shown_beside


@pytest.mark.parametrize(
    ("metric", "value", "limit", "shown"),
    [
        ("RD", 0.3003, 0.30, "0.3003"),
        ("RD", 0.64, 0.30, "0.64"),
        ("RD", 1.0 - 70.0 / 100.0, 0.30, "0.30"),
        ("RD", -0.001, 0.0, "-0.001"),
        ("RD", -0.001, 0.30, "0.00"),
        ("RD", 0.3000001, 0.30, "0.3000001"),
        ("DS", 69.97, 69.971, "69.97"),
        ("DS", 69.9996, 70.0, "69.9996"),
        ("SR", 0.995, 0.995, "0.995"),
        ("SR", None, 0.5, "-"),
        ("late", math.inf, 0.5, "-"),
    ],
)
def test_a_value_has_as_many_decimals_as_tell_it_from_its_limit(
    metric: str, value: float | None, limit: float, shown: str
) -> None:
    assert shown_beside(metric, value, limit) == shown


@given(st.floats(0.0, 100.0), st.integers(0, 100_000), st.integers(0, 3))
def test_what_is_printed_lies_on_the_side_of_the_value(value: float, hundredths: int, digits: int) -> None:
    limit = hundredths / 10**digits
    text = beside(value, limit)
    assert 2 <= len(text.partition(".")[2]) <= 9
    assert float(text) == pytest.approx(value, abs=0.005)
    if not math.isclose(value, limit, rel_tol=2e-9, abs_tol=2e-9):
        assert (float(text) > limit) == (value > limit)
        assert (float(text) < limit) == (value < limit)


def test_a_change_has_its_sign() -> None:
    assert beside(-5.0004, -5.0, decimals=1, sign="+") == "-5.0004"
    assert beside(0.0641, 0.04, sign="+") == "+0.06"
