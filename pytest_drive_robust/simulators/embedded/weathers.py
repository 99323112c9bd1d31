"""The 23 weathers that generated routes use, by name.

The leaderboard also draws from 23 weathers (Bench2Drive `leaderboard/data/weather.xml`): seven skies at noon, at sunset
and at night, and two single weathers. The numbers are our own, close to CARLA's public presets; fog is thinner, because
our cameras have no exposure control that would see through thick fog.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import product

from pytest_drive_robust.domain.route import Weather

_SKIES = {
    "clear": Weather(cloudiness=5.0, wind_intensity=10.0, fog_density=2.0),
    "cloudy": Weather(cloudiness=70.0, wind_intensity=20.0, fog_density=5.0),
    "wet": Weather(cloudiness=10.0, precipitation_deposits=50.0, wetness=60.0, fog_density=4.0),
    "wet cloudy": Weather(cloudiness=75.0, precipitation_deposits=60.0, wetness=70.0, fog_density=7.0),
    "soft rain": Weather(
        cloudiness=55.0, precipitation=25.0, precipitation_deposits=40.0, wetness=60.0, wind_intensity=25.0,
        fog_density=8.0,
    ),
    "mid rain": Weather(
        cloudiness=80.0, precipitation=55.0, precipitation_deposits=65.0, wetness=80.0, wind_intensity=50.0,
        fog_density=14.0,
    ),
    "hard rain": Weather(
        cloudiness=100.0, precipitation=100.0, precipitation_deposits=95.0, wetness=100.0, wind_intensity=90.0,
        fog_density=25.0,
    ),
}  # fmt: skip
_SUNS = {"noon": (-40.0, 58.0), "sunset": (-15.0, 7.0), "night": (-15.0, -40.0)}
"""Azimuth (clockwise from east) and altitude in degrees."""

WEATHERS: dict[str, Weather] = {
    **{
        f"{sky} {time}": replace(weather, sun_azimuth_angle=sun[0], sun_altitude_angle=sun[1])
        for (time, sun), (sky, weather) in product(_SUNS.items(), _SKIES.items())
    },
    "dense fog": Weather(
        cloudiness=85.0, wetness=20.0, wind_intensity=0.0, sun_azimuth_angle=60.0, sun_altitude_angle=30.0,
        fog_density=65.0,
    ),
    "dust storm": Weather(
        cloudiness=60.0, wind_intensity=100.0, sun_azimuth_angle=60.0, sun_altitude_angle=40.0, fog_density=45.0
    ),
}  # fmt: skip
"""Every weather by its name, fair ones first: `"clear noon"`, ..., `"hard rain night"`, `"dense fog"`, `"dust storm"`.

A dust storm is haze in a strong wind over dry ground: the leaderboard's attributes know no dust.
"""


def weather_name(weather: Weather) -> str:
    """Return the name of one of ours, or `"its own"` for any other.

    >>> weather_name(WEATHERS["mid rain sunset"]), weather_name(Weather(fog_density=99.0))
    ('mid rain sunset', 'its own')
    """
    return next((name for name, known in WEATHERS.items() if known == weather), "its own")
