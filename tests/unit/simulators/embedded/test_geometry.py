"""Lines in equal steps, against the same computed with numpy."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from pytest_drive_robust.arithmetic import arrays
from pytest_drive_robust.arithmetic.signals import interpolate
from pytest_drive_robust.simulators.embedded.geometry import resample

Floats = NDArray[np.float64]


def by_numpy(xy: Floats, step_m: float) -> Floats:
    xy = xy[np.concatenate([[True], arrays.hypot(*np.diff(xy, axis=0).T) > 1e-6])]
    s = np.concatenate([[0.0], np.cumsum(arrays.hypot(*np.diff(xy, axis=0).T))])
    at = np.linspace(0.0, s[-1], max(2, round(s[-1] / step_m) + 1))
    x, y = interpolate(at, s, xy).T
    return np.stack([x, y, np.unwrap(arrays.atan2(np.gradient(y), np.gradient(x)))], axis=1)


def test_steps_are_equal_and_headings_do_not_jump_bit_for_bit_as_numpy_computes_them() -> None:
    random = np.random.default_rng(0)
    for number in range(300):
        points = np.cumsum(
            random.normal(size=(int(random.integers(3, 50)), 2)) * random.choice([0.3, 1.0, 20.0]), axis=0
        )
        if number % 3 == 0:
            points[len(points) // 2] = points[len(points) // 2 - 1]
        if number % 5 == 0:
            points = np.round(np.concatenate([points, points[::-1]]))
            points[0] -= 1.0  # two points at least
        step_m = float(random.choice([0.5, 1.0, 2.0]))
        assert resample(points, step_m=step_m).tobytes() == by_numpy(points, step_m).tobytes()


def test_a_circle_driven_twice_turns_on() -> None:
    angle = np.linspace(0.0, 4.0 * np.pi, 400)
    heading = resample(np.stack([20.0 * np.cos(angle), 20.0 * np.sin(angle)], axis=1))[:, 2]
    assert heading[-1] - heading[0] == pytest.approx(4.0 * np.pi, abs=0.1)


def test_a_point_alone_is_a_line_without_length_and_no_point_is_refused() -> None:
    assert resample(np.array([[3.0, 4.0]])).tolist() == [[3.0, 4.0, 0.0]] * 2
    with pytest.raises(ValueError, match="at least one point"):
        resample(np.empty((0, 2)))
