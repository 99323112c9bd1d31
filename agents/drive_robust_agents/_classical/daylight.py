"""Detect day or night by the sky of the picture, and model the light of the vehicle's own headlamps."""

from __future__ import annotations

import numpy as np

from pytest_drive_robust.jit.arrays import Floats, Pixels

__all__ = ["NightDetector", "lamp_light"]

_SKY_ROWS, _SKY_STEP = slice(0, 24, 3), 8
"""The rows, and the step between the columns, in which the sky is looked at."""
_NIGHT_SKY = 75
"""Brightness (0..255) below which the sky is dark."""
_DEAD = 3
"""Greatest brightness of a dead pixel."""
_FOLLOW = 0.5
"""Share of a new look in the brightness of the sky."""
_LOOK_EVERY = 10
"""Pictures between two looks."""

_NEAREST_M, _FULL_M, _FADE_M = 2.0, 6.0, 22.0
"""Metres ahead at which the light begins, at which it is full, and over which it fades to half."""
_HALF_M, _WIDENS, _STEEP = 1.6, 0.35, 1.6
"""The beam: half its width at the vehicle, its widening per metre ahead, and how sharp its edge is."""


class NightDetector:
    """Detects night from the upper rows of the picture: the sky, or objects before the sky."""

    def __init__(self) -> None:
        self._sky: float | None = None
        self._looks = 0

    def see(self, pixels: Pixels) -> bool:
        """Return whether the sky is dark. Dead (black) pixels are skipped; a picture of dead pixels changes nothing."""
        if self._sky is None or self._looks % _LOOK_EVERY == 0:
            bright = pixels[_SKY_ROWS, ::_SKY_STEP].max(axis=2)
            alive = bright[bright > _DEAD]
            if len(alive):
                sky = float(np.median(alive))
                self._sky = sky if self._sky is None else self._sky + _FOLLOW * (sky - self._sky)
        self._looks += 1
        return self._sky is not None and self._sky < _NIGHT_SKY


def lamp_light(forward_m: Floats, right_m: Floats) -> Floats:
    """Return the headlamps' light, 0..1, on places of the ground given in metres ahead and to the right.

    The light is that of a calibrated pair of dipped headlamps: a cone that widens, is dark just before the bumper, and
    fades out.
    """
    beam = np.clip((1.0 - np.abs(right_m) / (_HALF_M + _WIDENS * np.maximum(forward_m, 0.0))) * _STEEP, 0.0, 1.0)
    near = np.clip((forward_m - _NEAREST_M) / (_FULL_M - _NEAREST_M), 0.0, 1.0)
    light: Floats = beam * near / (1.0 + (forward_m / _FADE_M) * (forward_m / _FADE_M))
    return light
