"""How far the run is: a live line on a terminal, now and then a plain line elsewhere."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import TYPE_CHECKING, Protocol, TextIO

from pytest_drive_robust.report.numbers import duration_text
from pytest_drive_robust.store.events import Asked, Event, Finished, Planned, Reused, Spared, Started

if TYPE_CHECKING:
    from rich.live import Live
    from rich.table import Table

__all__ = ["LiveProgress", "PlainProgress", "Progress", "ProgressState", "Screen", "SilentProgress"]

_REDRAW_S = 0.2
_PLAIN_S = 3.0
_HEARTBEAT_S = 30.0


class Screen(Protocol):
    """Where people look, as opposed to what pytest captures from tests."""

    def exclusive(self) -> AbstractContextManager[TextIO]:
        """Return the stream of the real terminal, at the start of a line, while nobody else writes to it."""
        ...


class ProgressState:
    """What the events so far add up to. `clock` is in seconds and only its differences count."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._keys: set[str] = set()
        self._finished: set[str] = set()
        self._driven = 0
        self._spared: set[str] = set()
        self._open: list[Asked] = []
        self._running: dict[str, Started] = {}
        self._began_s: float | None = None

    def see(self, event: Event) -> list[Asked]:
        """Take in an event. Returns the settings that it completed."""
        if isinstance(event, (Planned, Asked)):
            self._keys.update(event.keys)
        if isinstance(event, Asked) and event not in self._open and not self._finished.issuperset(event.keys):
            self._open.append(event)
        if isinstance(event, Asked):
            self._spared.difference_update(event.keys)
        if isinstance(event, Spared):
            self._spared.update(event.keys)
        if isinstance(event, Started):
            self._running[event.key] = event
            if self._began_s is None:
                self._began_s = self._clock()
        if isinstance(event, (Finished, Reused)):
            self._running.pop(event.key, None)
            self._finished.add(event.key)
        if isinstance(event, Finished):
            self._driven += 1
        over = self._finished | self._spared
        completed = [asked for asked in self._open if over.issuperset(asked.keys)]
        self._open = [asked for asked in self._open if asked not in completed]
        return completed

    @property
    def done(self) -> int:
        """Episodes that are finished."""
        return len(self._finished)

    @property
    def total(self) -> int:
        """Episodes that are known to be needed, without those that a verdict did not wait for."""
        return len((self._keys - self._spared) | self._finished)

    @property
    def left_s(self) -> float | None:
        """Seconds to go if it goes on as before; None before the first episode is finished."""
        if self._began_s is None or not self._driven:
            return None
        return (self._clock() - self._began_s) / self._driven * (self.total - self.done)

    @property
    def active(self) -> bool:
        """True while something is left to be driven."""
        return self.done < self.total

    def counts(self) -> str:
        """Return `"37/264 episodes, about 3 min left"`."""
        left = "" if self.left_s is None or self.done == self.total else f", about {duration_text(self.left_s)} left"
        return f"{self.done}/{self.total} episodes{left}"

    def now(self) -> str:
        """Return what is under way, of several the last: `"classical, 200 ms latency, 501 HardBreakRoute"`."""
        if not self._running:
            return ""
        last = list(self._running.values())[-1]
        others = f" (and {len(self._running) - 1} more)" if len(self._running) > 1 else ""
        return f"{last.agent}, {last.setting}, {last.route}{others}"


class Progress(Protocol):
    """A display of a run."""

    def see(self, event: Event) -> None:
        """Take in an event."""
        ...

    def refresh(self) -> None:
        """Show the present state. Called often; does something only now and then."""
        ...

    def pause(self) -> None:
        """Leave the terminal as if nothing had been drawn: somebody else is about to write."""
        ...


class SilentProgress:
    """For `-q` and `-p no:terminal`."""

    def see(self, event: Event) -> None:
        """Do nothing."""

    def refresh(self) -> None:
        """Do nothing."""

    def pause(self) -> None:
        """Do nothing."""


class PlainProgress:
    """A line when a setting is finished, at most one in three seconds, and a sign of life every half minute."""

    def __init__(self, screen: Screen, clock: Callable[[], float] = time.monotonic) -> None:
        self._screen = screen
        self._clock = clock
        self._state = ProgressState(clock)
        self._written_s = clock() - _PLAIN_S

    def see(self, event: Event) -> None:
        """Take in an event and perhaps write a line."""
        for asked in self._state.see(event):
            if self._clock() - self._written_s >= _PLAIN_S:
                self._write(f"{asked.agent} under {asked.setting} done, {self._state.counts()}")

    def refresh(self) -> None:
        """Write a sign of life when the last line is old."""
        if self._state.active and self._clock() - self._written_s >= _HEARTBEAT_S:
            self._write(f"{self._state.counts()}, now {self._state.now() or 'waiting'}")

    def pause(self) -> None:
        """Do nothing: lines stay."""

    def _write(self, text: str) -> None:
        self._written_s = self._clock()
        with self._screen.exclusive() as stream:
            stream.write(f"drive-robust: {text}\n")
            stream.flush()


class LiveProgress:
    """One line that is drawn over and over, gone when somebody else writes."""

    def __init__(self, screen: Screen, clock: Callable[[], float] = time.monotonic) -> None:
        self._screen = screen
        self._clock = clock
        self._state = ProgressState(clock)
        self._live: Live | None = None
        self._drawn_s = clock() - _REDRAW_S

    def see(self, event: Event) -> None:
        """Take in an event; drawing waits for `refresh`."""
        self._state.see(event)

    def refresh(self) -> None:
        """Draw, five times a second at most."""
        if not self._state.active or self._clock() - self._drawn_s < _REDRAW_S:
            return
        self._drawn_s = self._clock()
        with self._screen.exclusive() as stream:
            if self._live is None:
                self._live = _live_on(stream)
                self._live.start()
            self._live.update(_bar(self._state), refresh=True)

    def pause(self) -> None:
        """Take the line back."""
        if self._live is not None:
            with self._screen.exclusive():
                self._live.stop()
            self._live = None


def _live_on(stream: TextIO) -> Live:
    from rich.console import Console
    from rich.live import Live

    console = Console(file=stream, force_terminal=True)
    # pytest decides what is captured, so Live must not put itself in front of stdout and stderr.
    return Live(console=console, auto_refresh=False, transient=True, redirect_stdout=False, redirect_stderr=False)


def _bar(state: ProgressState) -> Table:
    from rich.progress_bar import ProgressBar
    from rich.table import Table
    from rich.text import Text

    grid = Table.grid(padding=(0, 1))
    for _ in range(3):
        grid.add_column(no_wrap=True, overflow="ellipsis")
    bar = ProgressBar(total=max(state.total, 1), completed=state.done, width=20)
    grid.add_row(bar, Text(state.counts()), Text(state.now(), style="dim"))
    return grid
