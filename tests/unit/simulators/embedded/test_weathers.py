"""Every weather has its own look, and the road can be seen in each."""

from __future__ import annotations

from dataclasses import astuple, replace
from itertools import combinations

import numpy as np
import pytest
from camera_scene import actor, around, frame, town
from numpy.typing import NDArray

from pytest_drive_robust.domain.observation import CameraSpec
from pytest_drive_robust.domain.route import Weather
from pytest_drive_robust.domain.truth import ActorKind, WorldState
from pytest_drive_robust.simulators.embedded.camera import CameraRig
from pytest_drive_robust.simulators.embedded.drawing.air import Air
from pytest_drive_robust.simulators.embedded.weathers import WEATHERS, weather_name

FRONT = CameraSpec("front", width_px=192, height_px=108)
TOWN = town()
CAR_AHEAD = actor(ActorKind.CAR, 18.0, 1.75)
Pixels = NDArray[np.uint8]


def shown(weather: Weather, seen: WorldState) -> NDArray[np.float64]:
    rig = CameraRig(TOWN, weather, [FRONT], around=around())
    return rig.render(seen)["front"].astype(np.float64)


def test_there_are_23_weathers_and_no_two_alike() -> None:
    assert len(WEATHERS) == 23
    assert len({astuple(weather) for weather in WEATHERS.values()}) == 23
    for sky in ("clear", "cloudy", "wet", "wet cloudy", "soft rain", "mid rain", "hard rain"):
        for time in ("noon", "sunset", "night"):
            assert f"{sky} {time}" in WEATHERS
    assert next(iter(WEATHERS)) == "clear noon"


def test_every_value_is_one_that_the_leaderboard_knows() -> None:
    for weather in WEATHERS.values():
        shares = (
            weather.cloudiness,
            weather.precipitation,
            weather.precipitation_deposits,
            weather.wetness,
            weather.wind_intensity,
            weather.fog_density,
        )
        assert all(0.0 <= share <= 100.0 for share in shares)
        assert -90.0 <= weather.sun_altitude_angle <= 90.0
        assert -180.0 <= weather.sun_azimuth_angle <= 360.0


def test_every_weather_has_its_name() -> None:
    for name in WEATHERS:
        assert weather_name(WEATHERS[name]) == name
    assert weather_name(Weather(wetness=12.5)) == "its own"


def test_no_two_weathers_look_alike() -> None:
    pictures = {name: shown(weather, frame(CAR_AHEAD)) for name, weather in WEATHERS.items()}
    for one, other in combinations(pictures, 2):
        apart = np.abs(pictures[one] - pictures[other]).mean()
        assert apart > 1.0, f"{one} and {other} differ by {apart:.2f} of 255 only"


@pytest.mark.parametrize("name", WEATHERS)
def test_a_car_18_m_ahead_and_the_lane_line_are_seen_in_every_weather(name: str) -> None:
    with_car, without = shown(WEATHERS[name], frame(CAR_AHEAD)), shown(WEATHERS[name], frame())
    assert (np.abs(with_car - without).max(axis=2) > 12.0).sum() > 60
    ground = without[80:, :, :].mean(axis=2)
    assert np.percentile(ground, 99.5) > 1.25 * np.median(ground)


def test_night_needs_lamps_noon_does_not() -> None:
    assert Air.of(WEATHERS["clear noon"]).night == 0.0
    assert Air.of(WEATHERS["clear night"]).night == 1.0
    assert 0.0 < Air.of(WEATHERS["clear sunset"]).night < 1.0


def test_dust_is_brown_haze_and_needs_wind_and_dry_ground() -> None:
    storm = WEATHERS["dust storm"]

    def brown(weather: Weather) -> float:
        red, _, blue = Air.of(weather).haze
        return red - blue

    assert brown(storm) > 50.0
    assert brown(replace(storm, wind_intensity=20.0)) < 5.0
    assert brown(replace(storm, wetness=60.0)) < 5.0


def test_shadows_run_away_from_the_sun_and_grow_towards_evening() -> None:
    noon, evening = Air.of(WEATHERS["clear noon"]), Air.of(WEATHERS["clear sunset"])
    for air in (noon, evening):
        assert air.cast[0] * air.disc[0] + air.cast[1] * air.disc[1] < 0.0
    assert np.hypot(*noon.cast) < 1.0 < np.hypot(*evening.cast)
    for name in ("cloudy noon", "soft rain noon", "hard rain sunset", "clear night", "dense fog", "dust storm"):
        assert Air.of(WEATHERS[name]).cast == (0.0, 0.0), name


def test_a_wet_road_mirrors_the_sky() -> None:
    dry = WEATHERS["cloudy noon"]
    wet = replace(dry, wetness=80.0)
    far = (slice(60, 66), slice(90, 102))
    assert Air.of(dry).mirror == 0.0
    assert Air.of(wet).mirror == 0.8
    sky = shown(dry, frame())[:40].mean()
    before, after = (shown(weather, frame())[far].mean() for weather in (dry, wet))
    assert abs(after - sky) < abs(before - sky) - 5.0
