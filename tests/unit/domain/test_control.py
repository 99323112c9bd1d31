"""What is a control, whatever library its numbers come from."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from pytest_drive_robust.domain.control import Control


@pytest.mark.parametrize("throttle", [0.5, 1, True, np.float32(0.5), np.int64(1), np.array(0.5)])
def test_numbers_of_any_library_are_taken(throttle: Any) -> None:
    assert Control(throttle=throttle).problem() is None


@pytest.mark.parametrize("throttle", ["0.5", b"0.5", bytearray(b"1"), np.str_("0.5"), None, [0.5], 10**400])
def test_what_is_no_number_is_told_as_it_is(throttle: Any) -> None:
    assert Control(throttle=throttle).problem() == f"throttle is {throttle!r}, expected a number in 0..1"


@pytest.mark.parametrize(("steer", "told"), [(float("nan"), "nan"), (np.float64(-1.5), "-1.5"), (2, "2.0")])
def test_a_number_out_of_range_is_told(steer: Any, told: str) -> None:
    assert Control(steer=steer).problem() == f"steer is {told}, expected a number in -1..1"
