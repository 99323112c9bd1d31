"""Day and night by the sky, and how far the headlamps reach."""

from __future__ import annotations

import numpy as np
from painted_roads import by_night, road

from drive_robust_agents._classical.daylight import NightDetector, lamp_light


def test_it_is_night_when_the_sky_is_dark_whatever_else_is_black() -> None:
    dusk, night, dead = NightDetector(), by_night(road()), np.zeros_like(road())
    assert not dusk.see(dead)
    assert not dusk.see(road())
    after = NightDetector()
    assert after.see(night)
    assert after.see(dead)


def test_the_headlamps_fade_to_the_sides_and_far_away() -> None:
    forward, right = np.array([1.5, 8.0, 8.0, 8.0, 40.0]), np.array([0.0, 0.0, 2.5, 6.0, 0.0])
    bumper, near, beside, outside, far = lamp_light(forward, right)
    assert bumper == outside == 0.0
    assert near > beside > 0.3
    assert near > 2.0 * far > 0.0
