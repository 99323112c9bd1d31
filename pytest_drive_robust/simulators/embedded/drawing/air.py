"""Effects of the weather on a picture: sky, light, haze, rain, wet roads."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pytest_drive_robust.arithmetic import arrays
from pytest_drive_robust.arithmetic.scalars import cos, power, sin, tan
from pytest_drive_robust.domain.route import Weather
from pytest_drive_robust.simulators.embedded.drawing.canvas import CameraView, Triple

Colour = tuple[float, float, float]

_DUST: Colour = (206.0, 168.0, 116.0)
_LAMPLIGHT: Colour = (92.0, 76.0, 52.0)
_LONGEST_SHADOW = 3.0
_LEAST_DIRECT = 0.6
_ZENITH_RISE = 0.45


class Air(NamedTuple):
    """Light and visibility. Colours are RGB 0..255, `light` is RGB factors.

    A surface of colour c whose normal is n shows c * light * (ambient + diffuse * max(0, n . sun)); the share
    1 - exp(-haze_per_m * depth) of it is replaced by `haze`. `sun` is the direction to the light (east, south, up; a
    unit vector), which never comes from below 15 degrees. `night` is 0 by day and 1 when lamps are needed,
    `rain` 0..1, `shadow` the factor of the ground below a vehicle.

    `mirror` 0..1 is how wet the ground is, and `sheen` is what wet ground mirrors at flat angles. `disc` is the
    direction to the sun (east, south, up; a unit vector), `glare` 0..1 how much the sun dazzles, and `cast` the length
    of a shadow on the ground, metres east and south per metre of height. `drops` 0..1 is the rain on the lens.
    """

    sky_top: Colour
    haze: Colour
    light: Colour
    sun: Triple
    ambient: float
    diffuse: float
    haze_per_m: float
    shadow: float
    night: float
    rain: float
    mirror: float
    sheen: Colour
    disc: Triple
    glare: float
    cast: tuple[float, float]
    drops: float

    @classmethod
    def of(cls, weather: Weather) -> Air:
        """Make a plain variant of CARLA's weather: day, dusk and night by the sun, clouds, fog, rain, dust."""
        height_deg = weather.sun_altitude_angle
        day = _ramp(height_deg, -8.0, 18.0)
        clouds, rain, fog = _share(weather.cloudiness), _share(weather.precipitation), _share(weather.fog_density)
        dust = math.sqrt(fog) * _dust(weather)
        low_sun = (1.0 - abs(2.0 * day - 1.0)) * (1.0 - 0.6 * clouds)
        grey, night = max(0.8 * clouds, rain, fog), 1.0 - _ramp(height_deg, -6.0, 10.0)
        sky_top, haze = _sky(day, low_sun, grey, rain)
        sky_top = _mix(_mix(sky_top, haze, power(fog, 0.6)), (0.0, 0.0, 0.0), 0.3 * rain)
        dusty = _mix((0.0, 0.0, 0.0), _DUST, 0.15 + 0.85 * day)
        haze = _mix(_mix(haze, (0.0, 0.0, 0.0), 0.25 * rain), dusty, dust)
        direct = (1.0 - grey) * (1.0 - dust)
        return cls(
            sky_top=_mix(sky_top, dusty, 0.9 * dust),
            haze=haze,
            light=_light(weather, day, low_sun, dust),
            sun=_direction(weather.sun_azimuth_angle, max(height_deg, 15.0)),
            ambient=0.62 + 0.2 * grey,
            diffuse=0.42 * (1.0 - 0.75 * grey),
            haze_per_m=0.0018 + 0.004 * rain + 0.055 * power(fog, 1.7),
            shadow=0.5 + 0.25 * grey,
            night=night,
            rain=rain,
            mirror=max(_share(weather.wetness), 0.8 * _share(weather.precipitation_deposits)),
            sheen=_mix(_mix(haze, sky_top, 0.3), _LAMPLIGHT, 0.6 * night),
            disc=_direction(weather.sun_azimuth_angle, height_deg),
            glare=_ramp(height_deg, -3.0, 3.0) * (1.0 - _ramp(height_deg, 12.0, 30.0)) * max(1.0 - 1.2 * grey, 0.0),
            cast=_cast(weather, direct),
            drops=_ramp(rain, 0.15, 1.0),
        )


def sky_rows(height: int, view: CameraView, air: Air) -> NDArray[np.uint32]:
    """Return packed colours 0x00BBGGRR (height,): haze at the horizon, `air.sky_top` high above it."""
    up = (height / 2.0 - np.arange(height) - 0.5) / view.focal_px
    rise = np.clip(view.sin_pitch + up * view.cos_pitch, 0.0, _ZENITH_RISE)
    share = arrays.power(rise / _ZENITH_RISE, 0.7)
    haze, top = np.array(air.haze), np.array(air.sky_top)
    colours = (haze + (top - haze) * share[:, None] + 0.5).astype(np.uint32)
    packed: NDArray[np.uint32] = colours[:, 0] | (colours[:, 1] << 8) | (colours[:, 2] << 16)
    return packed


def _sky(day: float, low_sun: float, grey: float, rain: float) -> tuple[Colour, Colour]:
    """Return the colours of the zenith and of the horizon, without fog, rain and dust."""
    top = _mix(_mix((9, 12, 34), (88, 142, 205), day), _mix((26, 24, 26), (150, 156, 164), day), grey)
    horizon = _mix(_mix((22, 26, 46), (196, 214, 230), day), _mix((40, 36, 36), (182, 186, 190), day), grey)
    horizon = _mix(horizon, (236, 150, 88), low_sun * 0.75 * (1.0 - grey))
    return top, _mix(horizon, (0.0, 0.0, 0.0), 0.1 * rain)


def _light(weather: Weather, day: float, low_sun: float, dust: float) -> Colour:
    """Return factors of a surface's colour: blue of the moon, gold of a low sun, darker under rain and when wet."""
    rain, clouds = _share(weather.precipitation), _share(weather.cloudiness)
    dark = 1.0 - 0.3 * rain - 0.08 * _share(weather.wetness) * (1.0 - rain)
    red, green, blue = _mix(_mix((0.16, 0.19, 0.3), (0.15, 0.145, 0.16), clouds), (1.0, 1.0, 1.0), day)
    gold = _mix((red, green, blue), (red * 1.2, green * 0.94, blue * 0.76), low_sun)
    red, green, blue = _mix(gold, (gold[0] * 0.96, gold[1] * 0.86, gold[2] * 0.68), dust)
    return red * dark, green * dark, blue * dark


def _dust(weather: Weather) -> float:
    """Return how much of the haze is dust, 0..1: all where a strong wind blows over dry ground."""
    dry = 1.0 - _ramp(weather.wetness + weather.precipitation + weather.precipitation_deposits, 0.0, 10.0)
    return dry * _ramp(weather.wind_intensity, 60.0, 100.0)


def _cast(weather: Weather, direct: float) -> tuple[float, float]:
    """Return the shadow's (east, south) run per metre of height; (0, 0) at night and with too little `direct` light."""
    if direct < _LEAST_DIRECT or weather.sun_altitude_angle < 1.0:
        return 0.0, 0.0
    run = min(1.0 / tan(math.radians(min(weather.sun_altitude_angle, 89.0))), _LONGEST_SHADOW)
    around = math.radians(weather.sun_azimuth_angle)
    return -run * cos(around), -run * sin(around)


def _direction(around_deg: float, height_deg: float) -> Triple:
    around, height = math.radians(around_deg), math.radians(height_deg)
    return cos(height) * cos(around), cos(height) * sin(around), sin(height)


def _share(percent: float) -> float:
    return min(max(percent / 100.0, 0.0), 1.0)


def _ramp(value: float, low: float, high: float) -> float:
    return min(max((value - low) / (high - low), 0.0), 1.0)


def _mix(first: Colour, second: Colour, share: float) -> Colour:
    red, green, blue = (a + (b - a) * share for a, b in zip(first, second, strict=True))
    return red, green, blue
