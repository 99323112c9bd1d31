"""Classes seen from above: where things are, the ego's heading up."""

from __future__ import annotations

import math

import numpy as np
import pytest
from camera_scene import actor, around, busy_frame, frame, town
from hypothesis import given, settings
from hypothesis import strategies as st

from pytest_drive_robust.domain.truth import ActorKind, LightState, WorldState
from pytest_drive_robust.errors import SimulationError
from pytest_drive_robust.simulators.embedded.semantic_bev import SemanticBev
from pytest_drive_robust.simulators.embedded.semantics import CLASS_OF_KIND, SemanticClass

TOWN = town()


def view(shown: WorldState, **options: float) -> np.ndarray:
    return SemanticBev(TOWN, around=around(), **options).render(shown)  # type: ignore[arg-type]


def at(classes: np.ndarray, ahead: float, right: float, *, size: int = 192, metres: float = 0.25) -> int:
    return int(classes[int((0.75 * size * metres - ahead) / metres), int((size / 2 * metres + right) / metres)])


def test_the_ground_lies_where_the_map_has_it() -> None:
    classes = view(frame(x=10.0, y=1.75))
    assert classes.shape == (192, 192)
    assert classes.dtype == np.uint8
    places = {
        (8.0, 0.0): SemanticClass.ROAD,
        (8.0, -3.5): SemanticClass.ROAD,
        (8.0, 5.5): SemanticClass.SIDEWALK,
        (8.0, 8.3): SemanticClass.TERRAIN,
        (8.0, 14.0): SemanticClass.BUILDING,
    }
    assert {place: at(classes, *place) for place in places} == places


@settings(max_examples=40, deadline=None)
@given(
    x=st.floats(0, 60), y=st.floats(-10, 10), yaw=st.floats(-7, 7), ahead=st.floats(-10, 30), right=st.floats(-20, 20)
)
def test_an_actor_is_where_it_is_in_the_ego_s_axes(x: float, y: float, yaw: float, ahead: float, right: float) -> None:
    c, s = math.cos(yaw), math.sin(yaw)
    truck = actor(ActorKind.TRUCK, x + c * ahead - s * right, y + s * ahead + c * right, yaw=yaw, number=1)
    classes = view(frame(truck, x=x, y=y, yaw=yaw))
    assert at(classes, ahead, right) == SemanticClass.TRUCK
    mask = classes == SemanticClass.TRUCK
    if abs(right) < 19.0 and ahead < 28.0 and ahead > -7.0:
        assert abs((36.0 - (np.nonzero(mask)[0].mean() + 0.5) * 0.25) - ahead) < 0.2
        assert abs(mask.sum() * 0.0625 - 8.5 * 2.5) < 3.0


def test_every_actor_is_at_least_one_pixel() -> None:
    for kind in ActorKind:
        classes = view(frame(actor(kind, 12.0, 4.0, number=2)), metres_per_pixel=1.0, size_px=48)
        assert (classes == CLASS_OF_KIND[kind]).any(), kind


def test_a_stop_line_says_what_it_demands() -> None:
    line = next(line for line in TOWN.stop_lines if line.is_light and math.cos(line.heading_rad) > 0.9)
    expected = {
        LightState.RED: SemanticClass.TRAFFIC_LIGHT,
        LightState.YELLOW: SemanticClass.TRAFFIC_LIGHT,
        LightState.GREEN: SemanticClass.ROAD_LINE,
    }
    for state, wanted in expected.items():
        lights = [LightState.GREEN, LightState.GREEN, LightState.STOP_SIGN]
        lights[line.index] = state
        classes = view(frame(x=line.x_m - 12.0, y=line.y_m, lights=tuple(lights)))
        assert at(classes, 12.0, 0.0) == wanted
        assert (classes == SemanticClass.TRAFFIC_SIGN).any()


def test_turning_the_ego_turns_the_view() -> None:
    east, west = view(frame(x=10.0, y=0.0)), view(frame(x=10.0, y=0.0, yaw=math.pi))
    assert at(east, 6.0, 7.3) == at(west, -6.0, -7.3) == SemanticClass.SIDEWALK
    assert (east != west).any()


def test_views_do_not_depend_on_what_was_seen_before() -> None:
    bev = SemanticBev(TOWN, around=around())
    bev.render(busy_frame(5))
    again = bev.render(frame(x=3.0)).copy()
    assert np.array_equal(again, view(frame(x=3.0)))


@pytest.mark.parametrize("options", [{"size_px": 0}, {"metres_per_pixel": 0.0}, {"metres_per_pixel": math.nan}])
def test_views_of_nothing_are_refused(options: dict[str, float]) -> None:
    with pytest.raises(SimulationError, match="shows nothing"):
        view(frame(), **options)
