"""Our filter is scipy's, to the last digits."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import savgol_filter

from pytest_drive_robust.metrics.smoothing import parabola_filter


@given(
    seed=st.integers(0, 2**32 - 1),
    samples=st.integers(3, 40),
    rows=st.integers(1, 5),
    derivative=st.sampled_from([0, 1]),
    step_s=st.sampled_from([0.05, 0.1, 1.0]),
)
def test_it_smooths_and_differentiates_as_scipy_does(seed, samples, rows, derivative, step_s):
    values = np.random.default_rng(seed).normal(scale=5.0, size=(rows, samples))
    window = min(7, samples)
    expected = savgol_filter(values, window, 2, deriv=derivative, delta=step_s, axis=-1)
    found = parabola_filter(values, window, derivative=derivative, step_s=step_s)
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-12 * np.abs(expected).max())


@pytest.mark.parametrize("samples", [3, 6, 7, 20])
def test_a_parabola_stays_itself_and_its_slope_is_exact(samples):
    time_s = np.arange(samples) * 0.05
    values = 3.0 - 2.0 * time_s + 7.0 * time_s**2
    smooth = parabola_filter(values, min(7, samples), derivative=0, step_s=0.05)
    slope = parabola_filter(values, min(7, samples), derivative=1, step_s=0.05)
    np.testing.assert_allclose(smooth, values, rtol=1e-12)
    np.testing.assert_allclose(slope, -2.0 + 14.0 * time_s, rtol=1e-11, atol=1e-11)


def test_a_row_does_not_depend_on_its_neighbours():
    values = np.random.default_rng(7).normal(size=(30, 20))
    together = parabola_filter(values, 7, derivative=1, step_s=0.1)
    alone = np.stack([parabola_filter(row, 7, derivative=1, step_s=0.1) for row in values])
    np.testing.assert_allclose(together, alone, rtol=1e-12, atol=1e-12)
