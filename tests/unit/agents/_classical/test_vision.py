"""What `classical` takes for ground, for an obstacle, for a lamp or a sign."""

from __future__ import annotations

import numpy as np
import pytest
from painted_roads import TYRE, by_night, paint, road

from drive_robust_agents._classical.corridor import oncoming
from drive_robust_agents._classical.vision import CAMERA, GroundModel, ground_pixels, signals


def test_a_dark_base_is_found_where_it_stands() -> None:
    image = road()
    paint(image, (12.0, 13.5), (-0.9, 0.9), TYRE)
    bases = GroundModel().bases(image)
    in_front = bases[np.abs(bases[:, 1]) < 0.8]
    assert len(in_front) > 5
    assert np.allclose(in_front[:, 0], 12.0, atol=0.8)


def test_markings_and_asphalt_are_free_road() -> None:
    assert len(GroundModel().bases(road())) == 0


def test_dead_pixels_hide_what_is_behind_them_and_are_no_obstacle() -> None:
    image = road()
    paint(image, (12.0, 13.5), (-0.9, 0.9), TYRE)
    image[CAMERA.height_px - 30 :] = 0
    assert len(GroundModel().bases(image)) == 0


@pytest.mark.parametrize("brighter", [0.8, 1.0, 1.2])
def test_the_edge_of_the_headlamps_is_no_obstacle(brighter: float) -> None:
    ground, image = GroundModel(), by_night(road(), brighter)
    found = [len(ground.bases(image)) for _ in range(30)]
    assert found[0] == found[-1] == 0


def test_light_of_a_street_lamp_on_the_road_is_no_obstacle() -> None:
    ground, image = GroundModel(), by_night(road())
    rows, columns = ground_pixels(*np.meshgrid(np.arange(9.0, 15.0, 0.02), np.linspace(-4.0, 4.0, 400)))
    lit = image.copy()
    lit[rows, columns] = np.minimum(image[rows, columns] * np.array([1.8, 1.7, 1.5]), 255.0)
    assert all(len(ground.bases(picture)) == 0 for picture in (image, lit, lit, lit, image))


def test_a_dark_base_in_the_headlamps_is_found_where_it_stands() -> None:
    image = road()
    paint(image, (12.0, 13.5), (-0.9, 0.9), TYRE)
    bases = GroundModel().bases(by_night(image))
    in_front = bases[np.abs(bases[:, 1]) < 0.8]
    assert len(in_front) > 5
    assert np.allclose(in_front[:, 0], 12.0, atol=0.8)


def test_lamps_that_come_towards_it_beside_the_headlamps_are_seen() -> None:
    image = by_night(road())
    paint(image, (14.0, 16.5), (-6.2, -5.0), (255, 255, 234))
    assert oncoming(GroundModel().bases(image))


def test_a_lamp_that_faces_the_camera_counts_and_one_seen_from_the_side_does_not() -> None:
    image = road()
    image[40:44, 150:154] = (255, 36, 28)
    image[40:46, 200:201] = (255, 36, 28)
    image[30:36, 180:182] = (40, 255, 90)
    seen = signals(image)
    assert (seen.red, seen.green, seen.sign) == (16, 0, 0)


def test_a_stop_sign_is_of_a_darker_red() -> None:
    image = road()
    image[60:66, 180:186] = (170, 18, 25)
    seen = signals(image)
    assert seen.sign == 36
    assert seen.red == 0
