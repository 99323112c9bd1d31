"""Where commands wait until they are due."""

from __future__ import annotations

from collections import deque

from pytest_drive_robust.domain.control import Control

__all__ = ["Fifo", "Hold"]


class Fifo:
    """A pipe of `ticks` commands, filled with the neutral one: one goes in and one comes out in every tick."""

    __slots__ = ("_newest", "_pipe")

    def __init__(self, ticks: int) -> None:
        self._pipe = deque([Control.NEUTRAL] * ticks)
        self._newest = Control.NEUTRAL

    def is_free(self, tick: int) -> bool:
        """Always: the agent runs in every tick."""
        return True

    def exchange(self, tick: int, control: Control | None, delay: int) -> Control:
        """Put the new command in (the last one again when there is none) and take the one that is due."""
        if control is not None:
            self._newest = control
        self._pipe.append(self._newest)
        return self._pipe.popleft()


class Hold:
    """A computer with one request at a time: busy until its command is due, which then holds until the next one is."""

    __slots__ = ("_current", "_due", "_pending")

    def __init__(self) -> None:
        self._current = Control.NEUTRAL
        self._pending: Control | None = None
        self._due = 0

    def is_free(self, tick: int) -> bool:
        """True from the tick on in which the last command is due."""
        return tick >= self._due

    def exchange(self, tick: int, control: Control | None, delay: int) -> Control:
        """Release the command that is due, start on the new one, and give the command that holds in this tick.

        A command that comes while the computer is busy is not a new one: in a stack, an earlier latency repeats its
        command in every tick.
        """
        if self._pending is not None and tick >= self._due:
            self._current, self._pending = self._pending, None
        if control is not None and tick >= self._due:
            self._due = tick + delay
            if delay == 0:
                self._current = control
            else:
                self._pending = control
        return self._current
