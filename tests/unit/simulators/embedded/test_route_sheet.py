"""Routes as people see them: the telling moment, one tile each, sheets of tiles."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from pytest_drive_robust.domain.observation import CameraSpec
from pytest_drive_robust.domain.route import Route
from pytest_drive_robust.simulators.embedded import state as c
from pytest_drive_robust.simulators.embedded.route_scene import telling_moment
from pytest_drive_robust.simulators.embedded.route_sets import named_routes
from pytest_drive_robust.simulators.embedded.route_sheet import TILES_PER_SHEET, draw_tile, lay_sheets

ROUTES = {route.scenario.type: route for route in named_routes("one-per-scenario")}


@pytest.mark.parametrize("route", ROUTES.values(), ids=lambda route: route.scenario.type)
def test_every_scenario_has_a_moment_between_trigger_and_end(route: Route) -> None:
    scene = telling_moment(route)
    dense = scene.world.dense
    assert scene.ridden_m <= dense.length_m
    away = np.hypot(dense.rows[:, 0] - scene.state.ego.x_m, dense.rows[:, 1] - scene.state.ego.y_m).min()
    assert away < 6.0
    triggered = scene.world.state.actor_ints[:, c.I_TRIGGER] != c.TRIGGER_NONE
    starts_in_a_bay = scene.world.stage.start_right_m != 0.0  # between parked cars: that is the moment
    if not triggered.any() and not starts_in_a_bay:
        assert scene.ridden_m > dense.trigger_m - 1.0


def test_the_pedestrian_is_on_the_way_and_its_path_is_known() -> None:
    scene = telling_moment(ROUTES["DynamicObjectCrossing"])
    walking = scene.world.state.actor_ints[:, c.I_MODE] == c.MODE_WALK
    assert scene.world.state.actors[walking, c.A_V].max() > 1.0
    assert scene.walks.shape == (int(walking.sum()), 2, 2)
    assert np.hypot(*(scene.walks[0, 1] - scene.walks[0, 0])) > 5.0


def test_the_same_route_and_seed_give_the_same_moment() -> None:
    first, again = (telling_moment(ROUTES["ParkingCutIn"], seed=3) for _ in range(2))
    assert first.state.tick == again.state.tick
    assert first.state.actors.tobytes() == again.state.actors.tobytes()


def test_a_tile_has_its_caption_and_shows_route_trigger_and_start() -> None:
    tile = draw_tile(telling_moment(ROUTES["ParkedObstacle"]), size_px=240)
    assert tile.dtype == np.uint8
    assert tile.shape[1:] == (240, 3)
    caption, picture = tile[: tile.shape[0] - 240], tile[-240:]
    assert (caption < 100).all(axis=2).sum() > 100
    for colour in ((60, 130, 255), (255, 60, 220), (40, 230, 240)):
        assert (np.abs(picture.astype(int) - colour).max(axis=2) < 60).sum() > 8


def test_with_a_camera_its_view_stands_on_the_right() -> None:
    scene = telling_moment(ROUTES["ParkedObstacle"])
    plain, wide = draw_tile(scene, size_px=180), draw_tile(scene, size_px=180, camera=CameraSpec("front"))
    assert wide.shape == (plain.shape[0], 180 + 320, 3)
    assert (wide[-180:, :180] == plain[-180:]).all()
    assert wide[-180:, 180:].std() > 10.0


def tiles(count: int) -> list[NDArray[np.uint8]]:
    return [np.full((40, 30, 3), number % 200, np.uint8) for number in range(count)]


def test_sheets_hold_48_tiles_in_reading_order_and_go_on_as_long_as_there_are_some() -> None:
    sheets = list(lay_sheets(tiles(TILES_PER_SHEET + 3)))
    assert len(sheets) == 2
    first, second = sheets
    assert first.shape[1] == second.shape[1]
    assert first.shape[0] > second.shape[0]
    numbers = list(dict.fromkeys(first[first.shape[0] // 6 // 2, :, 0].tolist()))
    assert [number for number in numbers if number < 200] == list(range(8))
    assert list(lay_sheets([])) == []


def test_few_tiles_make_a_narrow_sheet() -> None:
    (sheet,) = lay_sheets(tiles(3))
    assert sheet.shape[1] < 4 * 36
    (column,) = lay_sheets(tiles(3), columns=1)
    assert column.shape[0] > 3 * 40
