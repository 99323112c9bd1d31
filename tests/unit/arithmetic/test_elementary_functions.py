"""Elementary functions: their error against mpmath, and one result for floats, arrays and compiled code."""

from __future__ import annotations

import math
import struct
import sys
from collections.abc import Callable

import mpmath
import numba
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from pytest_drive_robust.arithmetic import arrays, compiled, scalars, series

ONE = ("atan", "cos", "exp", "log", "sin", "sinh", "tan")
TWO = ("atan2", "hypot", "power")
EXACT = {
    "atan": mpmath.atan, "atan2": mpmath.atan2, "cos": mpmath.cos, "exp": mpmath.exp, "hypot": mpmath.hypot,
    "log": mpmath.log, "power": mpmath.power, "sin": mpmath.sin,
    "sinh": mpmath.sinh, "tan": mpmath.tan,
}  # fmt: skip


def _kernel(function: Callable[[float], float]) -> Callable[[float], float]:
    @numba.njit(error_model="numpy")
    def kernel(x: float) -> float:
        return function(x)

    return kernel


def _kernel_of_two(function: Callable[[float, float], float]) -> Callable[[float, float], float]:
    @numba.njit(error_model="numpy")
    def kernel(x: float, y: float) -> float:
        return function(x, y)

    return kernel


KERNELS = {
    **{name: _kernel(getattr(compiled, name)) for name in ONE if hasattr(compiled, name)},
    **{name: _kernel_of_two(getattr(compiled, name)) for name in TWO if hasattr(compiled, name)},
}


def bits(value: float) -> bytes:
    """Return the bytes of a float, all NaN alike."""
    return b"nan" if value != value else struct.pack("<d", value)


def units_off(name: str, *x: float) -> float:
    """Return by how many units in the last place a function is off."""
    with mpmath.workprec(1200):
        exact = EXACT[name](*map(mpmath.mpf, x))
        error = abs(mpmath.mpf(getattr(scalars, name)(*x)) - exact)
        return float(error / mpmath.mpf(math.ulp(float(exact))))


def numbers(low: float, high: float) -> st.SearchStrategy[float]:
    return st.floats(low, high, allow_subnormal=False)


@pytest.mark.parametrize(
    ("name", "within", "units"),
    [
        *[(name, numbers(-1.0e6, 1.0e6), 1.0) for name in ("sin", "cos")],
        *[(name, numbers(-7.0, 7.0), 1.0) for name in ("sin", "cos")],
        ("tan", numbers(-1.0e6, 1.0e6), 2.0),
        ("tan", numbers(-7.0, 7.0), 2.0),
        ("atan", numbers(-sys.float_info.max, sys.float_info.max), 1.0),
        ("atan", numbers(-4.0, 4.0), 1.0),
        ("exp", numbers(-708.0, 709.0), 1.0),
        ("exp", numbers(-1.0, 1.0), 1.0),
        ("log", numbers(sys.float_info.min, sys.float_info.max), 1.0),
        ("log", numbers(0.5, 2.0), 1.0),
        ("sinh", numbers(-709.0, 709.0), 2.0),
        ("sinh", numbers(-2.0, 2.0), 2.0),
    ],
)
def test_a_function_of_one_number_keeps_its_error_bound(
    name: str, within: st.SearchStrategy[float], units: float
) -> None:
    @settings(max_examples=400, deadline=None)
    @given(x=within)
    def check(x: float) -> None:
        assert units_off(name, x) <= units

    check()


@pytest.mark.parametrize("name", ["sin", "cos", "tan"])
def test_angles_near_quarter_turns_keep_the_error_bound(name: str) -> None:
    rng = np.random.default_rng(0)
    for count in (*range(1, 200), *rng.integers(200, 630_000, 800).tolist()):
        with mpmath.workprec(200):
            nearest = float(count * mpmath.pi / 2)
        for angle in (nearest, math.nextafter(nearest, 0.0), math.nextafter(nearest, math.inf)):
            assert units_off(name, angle) <= (2.0 if name == "tan" else 1.0), angle


@settings(max_examples=400, deadline=None)
@given(x=numbers(-1e3, 1e3), y=numbers(-1e3, 1e3))
def test_a_direction_keeps_its_error_bound(x: float, y: float) -> None:
    if y != 0.0 and abs(scalars.atan2(y, x)) > sys.float_info.min:
        assert units_off("atan2", y, x) <= 2.0


@settings(max_examples=400, deadline=None)
@given(x=numbers(-1e150, 1e150), y=numbers(-1e150, 1e150))
def test_a_length_keeps_its_error_bound(x: float, y: float) -> None:
    if max(abs(x), abs(y)) > 1e-140:
        assert units_off("hypot", x, y) <= 1.0


@settings(max_examples=400, deadline=None)
@given(x=numbers(1e-9, 1e9), y=numbers(-10.0, 10.0))
def test_a_power_keeps_its_error_bound(x: float, y: float) -> None:
    assert units_off("power", x, y) <= 2.0 + 2.0 * abs(y * math.log(x))


SPECIAL = (0.0, -0.0, 1.0, -1.0, math.inf, -math.inf, math.nan, 1e22, -1e300, 5e-324, 1e-310, 0.4375, 2.4375, 1e6)


def require_agreement(x: float) -> None:
    for name in ONE:
        expected = bits(getattr(scalars, name)(x))
        if hasattr(arrays, name):
            assert bits(float(getattr(arrays, name)(np.array([x]))[0])) == expected, name
        if name in KERNELS:
            assert bits(KERNELS[name](x)) == expected, name


@settings(max_examples=1000, deadline=None)
@given(x=st.floats())
@example(x=math.pi)
@example(x=709.782712893384)
@example(x=-745.13)
def test_floats_arrays_and_compiled_code_agree_to_the_bit(x: float) -> None:
    require_agreement(x)


@pytest.mark.parametrize("x", SPECIAL)
def test_they_agree_on_special_numbers(x: float) -> None:
    require_agreement(x)


@settings(max_examples=300, deadline=None)
@given(x=st.floats(), y=st.floats())
def test_functions_of_two_numbers_agree_to_the_bit(x: float, y: float) -> None:
    for pair in ((x, y), *((x, other) for other in SPECIAL), *((other, x) for other in SPECIAL)):
        for name in TWO:
            if name == "hypot" and max(map(abs, pair)) > 1e150:
                continue
            expected = bits(getattr(scalars, name)(*pair))
            assert bits(float(getattr(arrays, name)(*map(np.float64, pair)))) == expected, (name, pair)
            if name in KERNELS:
                assert bits(KERNELS[name](*pair)) == expected, (name, pair)


_cosine_and_sine = _kernel(compiled.cos_sin)


def require_both(x: float) -> None:
    expected = bits(scalars.cos(x)), bits(scalars.sin(x))
    for pair in (scalars.cos_sin(x), _cosine_and_sine(x)):
        assert (bits(pair[0]), bits(pair[1])) == expected


@given(x=st.one_of(st.floats(), numbers(-1e6, 1e6)))
def test_a_cosine_and_a_sine_together_are_those_of_each_alone(x: float) -> None:
    require_both(x)


@pytest.mark.parametrize("x", SPECIAL)
def test_a_cosine_and_a_sine_of_special_numbers_too(x: float) -> None:
    require_both(x)


@given(x=st.floats(), y=st.floats())
def test_a_direction_is_in_the_quadrant_that_math_says(x: float, y: float) -> None:
    for pair in ((y, x), *((y, other) for other in SPECIAL), *((other, x) for other in SPECIAL)):
        ours, theirs = scalars.atan2(*pair), math.atan2(*pair)
        assert (ours == theirs == 0.0 and math.copysign(1, ours) == math.copysign(1, theirs)) or ours == pytest.approx(
            theirs, rel=1e-15, abs=5e-324, nan_ok=True
        )


@pytest.mark.parametrize("name", ["sin", "cos", "tan", "log"])
def test_what_has_no_value_is_nan(name: str) -> None:
    function = getattr(scalars, name)
    assert math.isnan(function(-math.inf))
    assert math.isnan(function(math.nan))


def test_what_is_too_large_is_infinite() -> None:
    assert scalars.exp(710.0) == scalars.exp(math.inf) == scalars.sinh(711.0) == math.inf
    assert scalars.exp(-746.0) == scalars.exp(-math.inf) == 0.0
    assert scalars.log(0.0) == -math.inf
    assert scalars.power(0.0, 2.0) == 0.0
    assert scalars.power(0.0, -2.0) == math.inf


@given(x=numbers(-1e9, 1e9))
def test_a_huge_angle_has_a_sine_and_a_cosine(x: float) -> None:
    x *= 1e7
    assert abs(scalars.sin(x)) <= 1.0
    assert abs(scalars.cos(x)) <= 1.0


@given(x=numbers(-1e6, 1e6))
def test_a_wrapped_angle_is_the_same_direction(x: float) -> None:
    wrapped = series.wrap_angle(x)
    assert abs(wrapped) <= math.pi + 1e-9
    assert math.remainder(wrapped - x, math.tau) == pytest.approx(0.0, abs=1e-9)
    if abs(x) < 3.14159:
        assert wrapped == x
    assert bits(float(series.wrap_angle(np.array([x]))[0])) == bits(wrapped)
