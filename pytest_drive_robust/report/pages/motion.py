"""Packs one episode into few bytes for a browser: the ego at 10 Hz, the signals given to the agent, the stored tracks.

::

    4 x 4 bytes   version, ticks between rows of the ego, the number of these rows, the number of rows told
    ego           x and y in cm (differences of differences), yaw in mrad, speed in cm/s, throttle, steer and brake in
                  thousandths, progress in dm (differences)
    told          tick, GPS x and y in dm, speed in dm/s, age of the oldest image in ticks (differences)

Tables are packed as in `store.track_bytes`; row `k` of the ego is the world after `k * every + 1` ticks. A told signal
that no perturbation touched is `UNTOUCHED`.
"""

from __future__ import annotations

import struct
import zlib
from base64 import b64encode

import numpy as np
from numpy.typing import NDArray

from pytest_drive_robust.domain.result import EpisodeResult, Given
from pytest_drive_robust.store.track_bytes import differences, int_planes, pack_tracks

VERSION = 1
UNTOUCHED = -1_000_000
_HEAD = struct.Struct("<4I")
_EVERY_TICKS = 2
_TOLD_EVERY_TICKS = 4
_COLUMNS = ("x_m", "y_m", "yaw_rad", "speed_mps", "throttle", "steer", "brake", "progress_m")
_SCALES = (100.0, 100.0, 1000.0, 100.0, 1000.0, 1000.0, 1000.0, 10.0)
_MOST = 1e9
_LEVEL = 6


def motion_text(result: EpisodeResult) -> str:
    """Return the motion of the ego and the told signals in base64; empty when no trace is stored."""
    if not result.ticks or not len(result.trace.rows):
        return ""
    columns = np.column_stack(result.trace.columns(*_COLUMNS))[::_EVERY_TICKS]
    columns[:, 2] = np.unwrap(columns[:, 2])
    ego = _whole(columns * _SCALES)
    told = _told(result)
    moved = differences(ego, [0])
    moved[:, :2] = differences(moved[:, :2], [0])
    head = _HEAD.pack(VERSION, _EVERY_TICKS, len(ego), len(told))
    data = b"".join((head, int_planes(moved), int_planes(differences(told, [0]))))
    return b64encode(zlib.compress(data, _LEVEL)).decode("ascii")


def tracks_text(result: EpisodeResult) -> str:
    """Return the stored tracks in base64; empty when no tracks are stored."""
    return "" if result.tracks is None else b64encode(pack_tracks(result.tracks)).decode("ascii")


def _told(result: EpisodeResult) -> NDArray[np.int32]:
    """Return the given signals that a perturbation touched, (rows, 5); no row when none touched any of them."""
    reception, given = result.reception, result.given
    if given is None or reception is None or not reception.touched or not len(given.rows):
        return np.zeros((0, 5), np.int32)
    rows = given.rows[::_TOLD_EVERY_TICKS].astype(np.float64)
    touched = {touch.signal for touch in reception.touched}
    told = np.full((len(rows), 5), float(UNTOUCHED))
    told[:, 0] = rows[:, 0]
    if "gps" in touched:
        told[:, 1:3] = rows[:, 1:3] * 10.0
    if "speed" in touched:
        told[:, 3] = rows[:, 4] * 10.0
    if touched & set(reception.cameras):
        oldest = np.fmin.reduce(rows[:, len(Given.COLUMNS) :], axis=1)
        told[:, 4] = np.where(np.isfinite(oldest), rows[:, 0] - oldest, UNTOUCHED)
    return _whole(told) if (told[:, 1:] != UNTOUCHED).any() else np.zeros((0, 5), np.int32)


def _whole(table: NDArray[np.float64]) -> NDArray[np.int32]:
    """Return the table rounded to int32; NaN becomes 0 and large values are clipped, which is enough for drawing."""
    return np.clip(np.nan_to_num(np.round(table)), -_MOST, _MOST).astype(np.int32)
