"""Find for each frame the frame of the same drive 0.5 s earlier, to train networks with a memory."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from drive_robust_agents._wrappers.memory import LAG_TICKS
from drive_robust_agents.training.data.rollouts import DAGGER, ON_WAY
from pytest_drive_robust.jit.arrays import Ints

__all__ = ["earlier_rows"]

_DRIVEN = (ON_WAY, DAGGER)


def earlier_rows(episode: NDArray[Any], tick: NDArray[Any], source: NDArray[Any]) -> Ints:
    """Return (n,) for each frame the row of the frame `LAG_TICKS` earlier in its episode, or -1.

    All arguments are (n,). Only driven frames (by `source`) can be remembered. A frame from a shifted pose remembers
    the drive from which it was shifted: its pose is known, so the memory can be moved to fit. The input of the frame's
    own motion must not be the difference of both poses, which would reveal the shift.
    """
    drives = (episode.astype(np.int64) << 24) + tick.astype(np.int64)
    driven = np.flatnonzero(np.isin(source, _DRIVEN))
    if not len(driven):
        return np.full(len(drives), -1, dtype=np.int64)
    driven = driven[np.argsort(drives[driven], kind="stable")]
    known, wanted = drives[driven], drives - LAG_TICKS
    place = np.minimum(np.searchsorted(known, wanted), len(known) - 1)
    return np.where(known[place] == wanted, driven[place], -1)
