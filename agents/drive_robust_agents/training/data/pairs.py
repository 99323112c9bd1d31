"""Which frame shows the same drive half a second before: what a network with a memory is trained on."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pytest_drive_robust.jit.arrays import Ints

__all__ = ["earlier_rows"]

_DRIVEN = (0, 3)


def earlier_rows(episode: NDArray[Any], tick: NDArray[Any], source: NDArray[Any], *, lag_ticks: int = 10) -> Ints:
    """Return for each of n frames the row of one `lag_ticks` before it in the same episode, or -1.

    All three are (n,). Only what was really driven (source 0 or 3) can be remembered. A frame from a shifted pose
    remembers the way that it was shifted from: its pose is known, so the memory can be moved to fit; but what it is
    told about its own motion must not be the difference of the two poses, which would give the shift away.
    """
    drives = (episode.astype(np.int64) << 24) + tick.astype(np.int64)
    driven = np.flatnonzero(np.isin(source, _DRIVEN))
    if not len(driven):
        return np.full(len(drives), -1, dtype=np.int64)
    driven = driven[np.argsort(drives[driven], kind="stable")]
    known, wanted = drives[driven], drives - lag_ticks
    place = np.minimum(np.searchsorted(known, wanted), len(known) - 1)
    return np.where(known[place] == wanted, driven[place], -1)
