"""What the weather does to a picture: sky, light, haze, rain."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from pytest_drive_robust.domain.route import Weather

__all__ = ["Air"]

Colour = tuple[float, float, float]


class Air(NamedTuple):
    """Light and visibility. Colours are RGB 0..255, `light` is RGB factors.

    A surface of colour c whose normal is n shows c * light * (ambient + diffuse * max(0, n . sun)); the share
    1 - exp(-haze_per_m * depth) of it is replaced by `haze`. `night` is 0 by day and 1 when lamps are needed,
    `rain` 0..1, `shadow` the factor of the ground below a vehicle.
    """

    sky_top: Colour
    haze: Colour
    light: Colour
    sun: Colour
    ambient: float
    diffuse: float
    haze_per_m: float
    shadow: float
    night: float
    rain: float

    @classmethod
    def of(cls, weather: Weather) -> Air:
        """Plain variants of CARLA's weather attributes: day, dusk and night by the sun, clouds, fog, rain."""
        day = _ramp(weather.sun_altitude_angle, -8.0, 18.0)
        low_sun = (1.0 - abs(2.0 * day - 1.0)) * (1.0 - _share(weather.cloudiness) * 0.6)
        grey = max(_share(weather.cloudiness) * 0.8, _share(weather.precipitation), _share(weather.fog_density))
        rain = _share(weather.precipitation)
        dark = 1.0 - 0.3 * rain - 0.12 * _share(weather.wetness) * (1.0 - rain)
        light = _mix((0.15, 0.17, 0.26), (1.0, 1.0, 1.0), day)
        light = _mix(light, (light[0] * 1.15, light[1] * 0.92, light[2] * 0.78), low_sun)
        sky_top = _mix(_mix((9, 12, 30), (88, 142, 205), day), _mix((14, 15, 20), (150, 156, 164), day), grey)
        haze = _mix(_mix((22, 26, 44), (196, 214, 230), day), _mix((24, 26, 32), (182, 186, 190), day), grey)
        haze = _mix(haze, (224, 150, 96), low_sun * 0.6 * (1.0 - grey))
        sun_rad, around_rad = (
            math.radians(max(weather.sun_altitude_angle, 15.0)),
            math.radians(weather.sun_azimuth_angle),
        )
        return cls(
            sky_top=_mix(_mix(sky_top, haze, _share(weather.fog_density) ** 0.6), (0, 0, 0), 0.3 * rain),
            haze=_mix(haze, (0, 0, 0), 0.25 * rain),
            light=(light[0] * dark, light[1] * dark, light[2] * dark),
            sun=(
                math.cos(sun_rad) * math.cos(around_rad),
                math.cos(sun_rad) * math.sin(around_rad),
                math.sin(sun_rad),
            ),
            ambient=0.62 + 0.2 * grey,
            diffuse=0.42 * (1.0 - 0.75 * grey),
            haze_per_m=0.0018 + 0.004 * rain + 0.055 * _share(weather.fog_density) ** 1.7,
            shadow=0.5 + 0.25 * grey,
            night=1.0 - _ramp(weather.sun_altitude_angle, -6.0, 10.0),
            rain=rain,
        )


def _share(percent: float) -> float:
    return min(max(percent / 100.0, 0.0), 1.0)


def _ramp(value: float, low: float, high: float) -> float:
    return min(max((value - low) / (high - low), 0.0), 1.0)


def _mix(first: Colour, second: Colour, share: float) -> Colour:
    red, green, blue = (a + (b - a) * share for a, b in zip(first, second, strict=True))
    return red, green, blue
