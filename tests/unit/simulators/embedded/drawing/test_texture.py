"""The ground texture: what is painted where, in levels that agree, drawn once for equal maps."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from camera_scene import around, town

from pytest_drive_robust.simulators.embedded.drawing import texture as texture_module
from pytest_drive_robust.simulators.embedded.drawing.packed import unpack
from pytest_drive_robust.simulators.embedded.drawing.paint import (
    ASPHALT,
    GRASS,
    PARKING,
    SIDEWALK,
    Region,
    paint_ground,
)
from pytest_drive_robust.simulators.embedded.drawing.texture import ground_texture, pack_sheet, texture_regions

REGION = Region(-20.0, -20.0, 400, 400, 0.1)


def at(picture: np.ndarray, x_m: float, y_m: float) -> int:
    return int(picture[int((y_m - REGION.y_m) / REGION.texel_m), int((x_m - REGION.x_m) / REGION.texel_m)])


def test_every_kind_of_lane_has_its_material() -> None:
    material = paint_ground(town(), REGION).material
    places = {(3.0, 1.75): ASPHALT, (3.0, 4.75): PARKING, (3.0, 7.25): SIDEWALK, (3.0, 15.0): GRASS}
    assert {place: at(material, *place) for place in places} == places


def test_lines_against_oncoming_traffic_are_yellow_and_the_others_white() -> None:
    sheet = paint_ground(town(), REGION)
    centre, edge = slice(195, 206), slice(225, 246)  # rows around y = 0 and y = 3.5
    assert sheet.yellow[centre].max() == 255
    assert sheet.white[centre].max() == 0
    assert sheet.white[edge].max() == 255
    assert sheet.yellow[edge].max() == 0


def test_the_dashes_of_a_shared_line_are_drawn_once() -> None:
    painted = paint_ground(town(), REGION).yellow[200] > 127
    assert 0.3 < painted.mean() < 0.5  # 3 m of every 7.5 m


def test_equal_maps_share_one_texture_and_other_maps_do_not() -> None:
    first = ground_texture(town(), around())
    assert ground_texture(town(), around()) is first
    repainted = town()
    lanes = (replace(repainted.lanes[0], left_line="solid"), *repainted.lanes[1:])
    assert ground_texture(replace(repainted, lanes=lanes), around()) is not first
    assert ground_texture(town(), around() + 50.0) is not first


def test_levels_show_the_same_ground_at_half_the_resolution() -> None:
    texture = ground_texture(town(), around())
    pictures = []
    for first, columns, rows, *_ in texture.levels[:2].astype(int):
        pictures.append(unpack(texture.texels[first : first + columns * rows].reshape(rows, columns)).astype(float))
    fine, coarse = pictures
    mean = fine.reshape(coarse.shape[0], 2, coarse.shape[1], 2, 3).mean(axis=(1, 3))
    assert np.abs(mean - coarse).max() <= 0.75
    assert np.allclose(texture.levels[1:, 5], 2.0 * texture.levels[:-1, 5])


def test_the_grain_belongs_to_the_place_and_not_to_the_region() -> None:
    shifted = Region(-10.0, -5.0, 200, 200, 0.1)
    whole, part = (unpack(pack_sheet(paint_ground(town(), region))) for region in (REGION, shifted))
    grass = np.s_[170:200, :]  # y from 12 to 15 m: nothing is painted there
    assert np.array_equal(part[grass], whole[150:350, 100:300][grass])


def test_a_long_route_has_larger_texels_and_not_more_of_them(monkeypatch: pytest.MonkeyPatch) -> None:
    def texels(region: Region) -> int:
        return region.columns * region.rows

    for extent_m in (50.0, 300.0, 1770.0, 3400.0):  # the last two: 2.5 and 4.8 km across
        near, wide = texture_regions(np.array([(0.0, 0.0), (extent_m, extent_m)]))
        assert texels(near) + texels(wide) < 1.5e8
        assert wide.texel_m == 2.0 * near.texel_m
        assert (near.texel_m == 0.1) is (extent_m < 900.0)
    monkeypatch.setattr(texture_module, "_MOST_TEXELS", 250_000)
    texture = ground_texture(town(), np.array([(0.0, 0.0), (300.0, 300.0)]))
    assert texture.texels.nbytes < 4 * 2 * 250_000
    assert texture.levels[:, 5].tolist() == [texture.levels[0, 5] * 2.0**level for level in range(7)]


def test_textures_are_kept_up_to_a_number_of_bytes(monkeypatch: pytest.MonkeyPatch) -> None:
    texture_module._kept.clear()
    first = ground_texture(town(), around())
    monkeypatch.setattr(texture_module, "_CACHED_BYTES", 2 * first.texels.nbytes)
    second = ground_texture(town(), around() + 50.0)
    assert ground_texture(town(), around()) is first
    ground_texture(town(), around() + 100.0)
    assert ground_texture(town(), around()) is first
    assert ground_texture(town(), around() + 50.0) is not second
    monkeypatch.setattr(texture_module, "_CACHED_BYTES", 1)
    alone = ground_texture(town(), around())
    assert list(texture_module._kept.values()) == [alone]
