"""Interpolation and moving sums against numpy's."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pytest_drive_robust.arithmetic.signals import interpolate, moving_sum

numbers = st.floats(-1e3, 1e3).map(lambda value: round(value, 6))


@given(
    x=st.lists(numbers, min_size=2, max_size=20, unique=True),
    at=st.lists(numbers, max_size=20),
    seed=st.integers(0, 99),
)
def test_a_line_is_interpolated_as_numpy_does(x: list[float], at: list[float], seed: int) -> None:
    known = np.sort(np.array(x))
    heights = np.random.default_rng(seed).normal(size=len(known))
    places = np.array([*at, *known])
    ours = interpolate(places, known, heights)
    assert ours == pytest.approx(np.interp(places, known, heights), rel=1e-12, abs=1e-12)
    assert ours[len(at) :] == pytest.approx(heights, rel=1e-12, abs=1e-12)
    both = interpolate(places, known, np.column_stack([heights, -heights]))
    assert both[:, 0].tolist() == ours.tolist()
    assert both[:, 1].tolist() == (-ours).tolist()


@given(count=st.integers(1, 12), longer=st.integers(0, 12), seed=st.integers(0, 99))
def test_a_moving_sum_is_a_convolution(count: int, longer: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    weights, values = rng.normal(size=count), rng.normal(size=count + longer)
    expected = np.convolve(values, weights[::-1], mode="valid")
    assert moving_sum(values, weights.tolist()) == pytest.approx(expected, rel=1e-9, abs=1e-12)
    rows = np.stack([values, 2.0 * values])
    assert moving_sum(rows, weights.tolist())[1] == pytest.approx(2.0 * expected, rel=1e-9, abs=1e-12)
