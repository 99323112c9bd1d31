"""The colour of the sky by rows of pixels: it depends on camera and weather only."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pytest_drive_robust.arithmetic.arrays import power

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pytest_drive_robust.simulators.embedded.drawing.air import Air
    from pytest_drive_robust.simulators.embedded.drawing.view import CameraView

__all__ = ["sky_rows"]

_ZENITH_RISE = 0.45


def sky_rows(height: int, view: CameraView, air: Air) -> NDArray[np.uint32]:
    """Return packed colours 0x00BBGGRR (height,): haze at the horizon, `air.sky_top` high above it."""
    up = (height / 2.0 - np.arange(height) - 0.5) / view.focal_px
    rise = np.clip(view.sin_pitch + up * view.cos_pitch, 0.0, _ZENITH_RISE)
    share = power(rise / _ZENITH_RISE, 0.7)
    haze, top = np.array(air.haze), np.array(air.sky_top)
    colours = (haze + (top - haze) * share[:, None] + 0.5).astype(np.uint32)
    packed: NDArray[np.uint32] = colours[:, 0] | (colours[:, 1] << 8) | (colours[:, 2] << 16)
    return packed
