"""Shows the progress of a run: a live line on a terminal, a plain line now and then elsewhere."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import TYPE_CHECKING, TextIO

from pytest_drive_robust.report.progress_state import ProgressState
from pytest_drive_robust.store.events import Event

if TYPE_CHECKING:
    from rich.live import Live
    from rich.table import Table

_REDRAW_S = 0.2
_PLAIN_S = 3.0
_HEARTBEAT_S = 30.0
_COMPILING_S = 5.0
Screen = Callable[[], AbstractContextManager[TextIO]]
"""Opens the stream of the real terminal, not the stream that pytest captures, at the start of a line; while the stream
is open, nothing else writes to the terminal.
"""
Leave = Callable[[], int]
"""Returns the column at which the line above goes on after the drawing; 0 when nothing above goes on."""


class Progress:
    """A display of a run. This base class shows nothing and is used for `-q` and `-p no:terminal`."""

    def see(self, event: Event) -> None:
        """Take in an event."""

    def refresh(self) -> None:
        """Show the present state. Called often; subclasses draw only now and then."""

    def pause(self) -> None:
        """Clear the drawing from the terminal, because other output follows."""


class PlainProgress(Progress):
    """Writes a line when a setting is finished, at most one in 3 s, and a sign of life every 30 s.

    While functions are being compiled, writes a line at once and then one every 5 s. A problem of the store is a line
    of its own at once.
    """

    def __init__(self, screen: Screen, clock: Callable[[], float] = time.monotonic) -> None:
        self._screen = screen
        self._clock = clock
        self._state = ProgressState(clock)
        self._written_s = clock() - _PLAIN_S
        self._compiling_s: float | None = None

    def see(self, event: Event) -> None:
        """Take in an event and perhaps write a line."""
        if trouble := self._state.trouble(event):
            _write_line(self._screen, trouble)
        for needed in self._state.see(event)[-1:]:  # clean twins come first: name the last setting
            if self._clock() - self._written_s >= _PLAIN_S:
                self._write(f"{needed.agent} under {needed.setting} done, {self._state.counts()}")

    def refresh(self) -> None:
        """Write a sign of life when the last line is old."""
        if self._state.compiled is not None:
            if self._compiling_s is None or self._clock() - self._compiling_s >= _COMPILING_S:
                self._compiling_s = self._clock()
                self._write(self._state.compiling())
        elif self._clock() - self._written_s >= _HEARTBEAT_S and self._state.active:
            self._write(f"{self._state.counts()}, now {self._state.now() or 'waiting'}")

    def _write(self, text: str) -> None:
        self._written_s = self._clock()
        _write_line(self._screen, text)


class LiveProgress(Progress):
    """Draws one line again and again, removes the line before other output, and goes back to the line above.

    A problem of the store is written to `lines` (default: `screen`) at once, and stays.
    """

    def __init__(
        self,
        screen: Screen,
        clock: Callable[[], float] = time.monotonic,
        *,
        leave: Leave = lambda: 0,
        lines: Screen | None = None,
    ) -> None:
        self._screen = screen
        self._leave = leave
        self._lines = lines or screen
        self._clock = clock
        self._state = ProgressState(clock)
        self._live: Live | None = None
        self._drawn_s = clock() - _REDRAW_S

    def see(self, event: Event) -> None:
        """Take in an event; drawing waits for `refresh`."""
        self._state.see(event)
        if trouble := self._state.trouble(event):
            self.pause()
            _write_line(self._lines, trouble)

    def refresh(self) -> None:
        """Draw the line, five times a second at most."""
        if self._clock() - self._drawn_s < _REDRAW_S or not self._state.active:
            return
        self._drawn_s = self._clock()
        with self._screen() as stream:
            if self._live is None:
                self._live = _live_on(stream)
                self._live.start()
            self._live.update(_bar(self._state), refresh=True)

    def pause(self) -> None:
        """Remove the line, and go back to where the line above goes on."""
        if self._live is None:
            return
        from rich.control import Control

        with self._screen():
            self._live.stop()
            if column := self._leave():
                self._live.console.control(Control.move(x=column, y=-1))
        self._live = None


def _write_line(screen: Screen, text: str) -> None:
    with screen() as stream:
        stream.write(f"drive-robust: {text}\n")
        stream.flush()


def _live_on(stream: TextIO) -> Live:
    from rich.console import Console
    from rich.live import Live

    console = Console(file=stream, force_terminal=True)
    # pytest captures stdout and stderr, so Live must not redirect them.
    return Live(console=console, auto_refresh=False, transient=True, redirect_stdout=False, redirect_stderr=False)


def _bar(state: ProgressState) -> Table:
    from rich.progress_bar import ProgressBar
    from rich.table import Table
    from rich.text import Text

    grid = Table.grid(padding=(0, 1))
    for may_shrink in (False, False, True):  # a full line cuts the running episode, not the time left
        grid.add_column(no_wrap=not may_shrink)
    done, total = state.compiled or (state.done, state.total)
    texts = (state.compiling(), "") if state.compiled is not None else (state.counts(), state.now())
    now = Text(texts[1], style="dim", no_wrap=True, overflow="ellipsis")
    grid.add_row(ProgressBar(total=max(total, 1), completed=done, width=20), Text(texts[0]), now)
    return grid
