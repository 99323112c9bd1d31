"""A clock that stands still while this process is stopped, as in a paused container: that time is no agent's."""

from __future__ import annotations

import time
from collections.abc import Callable

LONGEST_WAIT_S = 1.0
"""The longest time in seconds between two readings of the clock by a process that runs."""
_STOPPED_S = 5.0
"""Seconds between two readings after which this process must have been stopped, however busy the machine is."""


class AwakeClock:
    """Measures durations without the time in which this process was stopped. To be read every `LONGEST_WAIT_S`.

    Who stops a worker alone (SIGSTOP) stops no clock: that is a call which does not return.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._read_s = clock()
        self._stops: list[tuple[float, float]] = []  # begin and end

    def since(self, start_s: float) -> float:
        """Return the seconds since `start_s`, a time of `time.monotonic`."""
        now_s = self._clock()
        if now_s - self._read_s > _STOPPED_S:
            self._stops.append((self._read_s, now_s))
        self._read_s = now_s
        return now_s - start_s - sum(end_s - max(begin_s, start_s) for begin_s, end_s in self._stops if end_s > start_s)
