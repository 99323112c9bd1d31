"""The nearest lane is the nearest lane, wherever the ego was before."""

from __future__ import annotations

import numba
import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from pytest_drive_robust.simulators.embedded.criteria import nearest_lane
from pytest_drive_robust.simulators.embedded.routes import named_routes
from pytest_drive_robust.simulators.embedded.state import Statics
from pytest_drive_robust.simulators.embedded.world import World

_WANTED = ("SignalizedJunctionLeftTurn", "MergerIntoSlowTraffic", "ParkingExit", "InterurbanActorFlow")
WORLDS = [World(route, seed=0) for route in named_routes("one-per-scenario") if route.scenario.type in _WANTED]


@numba.njit(error_model="numpy")
def found(statics: Statics, x: float, y: float, last: int) -> tuple[int, float, float]:
    return nearest_lane(statics, x, y, last)


@settings(max_examples=200, deadline=None)
@given(
    world=st.sampled_from(WORLDS),
    row=st.integers(0, 10**6),
    ahead_m=st.floats(-40.0, 40.0),
    right_m=st.one_of(st.floats(-8.0, 8.0), st.floats(-900.0, 900.0)),
)
def test_what_was_nearest_before_changes_nothing(world: World, row: int, ahead_m: float, right_m: float) -> None:
    statics = world.statics
    x, y, heading = statics.lanes[row % len(statics.lanes)]
    x += ahead_m * np.cos(heading) - right_m * np.sin(heading)
    y += ahead_m * np.sin(heading) + right_m * np.cos(heading)
    away = np.sqrt((x - statics.lanes[:, 0]) ** 2 + (y - statics.lanes[:, 1]) ** 2)
    nearest = found(statics, x, y, -1)
    assert away[statics.lane_of == nearest[0]].min() <= away.min() + 1e-9
    for last in sorted(set(statics.lane_of.tolist())):
        assert found(statics, x, y, last) == nearest
