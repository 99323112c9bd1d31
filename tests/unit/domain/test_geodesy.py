"""Latitudes and longitudes of CARLA's towns."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pytest_drive_robust.domain.geodesy import to_geodetic, to_metric

metres = st.floats(-1e5, 1e5)


@given(x=metres, y=metres)
def test_there_and_back_is_the_same_place(x: float, y: float) -> None:
    assert to_metric(*to_geodetic(x, y)) == pytest.approx((x, y), abs=1e-6)


@pytest.mark.parametrize("latitude", [91.0, -90.0, float("nan")])
def test_a_latitude_beyond_the_poles_is_refused(latitude: float) -> None:
    with pytest.raises(ValueError, match="latitude"):
        to_metric(latitude, 0.0)
