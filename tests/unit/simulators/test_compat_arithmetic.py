"""Our kernels round as numpy does on this machine."""

from __future__ import annotations

import math
import os
import platform
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pytest_drive_robust.simulators.compat import arithmetic

MACHINE = arithmetic.machine()
needs_exact = pytest.mark.skipif(not arithmetic.is_exact(), reason="numpy's loops cannot be called here")

angles = st.floats(-20.0, 20.0)
shares = st.floats(-1.0, 1.0)
lengths = st.floats(-1e4, 1e4)


@needs_exact
@settings(max_examples=200, deadline=None)
@given(angle=angles, share=shares, x=lengths, y=lengths, exponent=st.sampled_from([2.0, 4.0, 3.7]))
def test_functions_give_the_bits_of_numpy(angle: float, share: float, x: float, y: float, exponent: float) -> None:
    assert arithmetic.sin(MACHINE, angle) == np.sin(angle)
    assert arithmetic.cos(MACHINE, angle) == np.cos(angle)
    assert arithmetic.tan(MACHINE, share) == np.tan(share)
    assert arithmetic.arcsin(MACHINE, share) == np.arcsin(share)
    assert arithmetic.arctan(MACHINE, x) == np.arctan(x)
    assert arithmetic.arctan2(MACHINE, y, x) == np.arctan2(y, x)
    assert arithmetic.power(MACHINE, abs(angle), exponent) == np.power(abs(angle), exponent)
    assert arithmetic.scalar_power(angle, 2.0) == angle**2.0


@needs_exact
@settings(max_examples=200, deadline=None)
@given(numbers=st.lists(lengths, min_size=6, max_size=6))
def test_products_give_the_bits_of_numpy(numbers: list[float]) -> None:
    a, b = np.array(numbers[:2]), np.array(numbers[2:4])
    u, v = np.array(numbers[:3]), np.array(numbers[3:])
    assert arithmetic.dot2(MACHINE, *a, *b) == np.dot(a, b)
    assert arithmetic.dot3(MACHINE, *u, *v) == np.dot(u, v)
    assert math.sqrt(arithmetic.dot2(MACHINE, *a, *a)) == np.linalg.norm(a)
    turned = np.array([a, b]) @ np.tile(u[:2], (4, 1)).T
    assert [arithmetic.turn2(MACHINE, *row, *u[:2]) for row in (a, b)] == turned[:, 3].tolist()


def test_without_numpys_loops_libm_serves() -> None:
    nothing_known = np.zeros_like(MACHINE)
    for x in np.linspace(-0.99, 0.99, 41):
        assert arithmetic.arcsin(nothing_known, x) == pytest.approx(math.asin(x), abs=1e-15)
        assert arithmetic.arctan2(nothing_known, x, 0.3) == pytest.approx(math.atan2(x, 0.3), abs=1e-15)
        assert arithmetic.power(nothing_known, abs(x), 3.7) == pytest.approx(abs(x) ** 3.7, abs=1e-15)
        assert arithmetic.dot2(nothing_known, x, 1.7, 0.3, x) == x * 0.3 + 1.7 * x


@pytest.mark.skipif(platform.machine() != "x86_64", reason="names a kernel of x86-64")
def test_a_processor_whose_products_are_not_fused_is_matched_too() -> None:
    code = (
        "from pytest_drive_robust.simulators.compat import arithmetic as a;"
        "print(a.is_exact(), a.dot2(a.machine(), 1.1, 1.3, 1.7, 1.9) == 1.1 * 1.7 + 1.3 * 1.9)"
    )
    environment = {**os.environ, "OPENBLAS_CORETYPE": "Nehalem"}
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["True", "True"]


def test_numpy_is_matched_where_these_tests_are_developed() -> None:
    """CPython with x86-64 numpy: the addresses are found and every sample agrees."""
    if platform.python_implementation() != "CPython" or platform.machine() != "x86_64":
        pytest.skip("another kind of machine")
    assert arithmetic.is_exact()
