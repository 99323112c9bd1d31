"""Writes to the terminal past pytest's capturing, and chooses the progress display for that terminal."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from typing import Any, TextIO

import pytest

from pytest_drive_robust.report.progress import LiveProgress, PlainProgress, Progress

_DUMB = ("dumb", "unknown")
"""Values of `TERM` for terminals that cannot move the cursor; `rich`, which draws, has the same two."""


class Terminal:
    """The real standard output, where pytest itself writes.

    `reporter` is pytest's terminal reporter, `capture` its capture manager (None under `-p no:capture`), `writer` its
    terminal writer.
    """

    def __init__(self, reporter: Any, capture: Any, writer: Any) -> None:
        self._reporter = reporter
        self._capture = capture
        self._writer = writer
        self._above: int | None = None

    @contextmanager
    def at_line_start(self) -> Iterator[TextIO]:
        """Yield the output at the start of a line, with capturing suspended. A line of pytest ends here."""
        with self._uncaptured() as stream:
            self._end_line()
            yield stream

    @contextmanager
    def below(self) -> Iterator[TextIO]:
        """Yield the output, at first on the line below that of pytest, which goes on after `leave`."""
        with self._uncaptured() as stream:
            if self._above is None:
                width = self._writer.width_of_current_line
                if 0 < width < self._writer.fullwidth:
                    stream.write("\n")  # past the writer, which takes the line above for the one it is in
                    self._above = width
                else:
                    self._end_line()
                    self._above = 0
            yield stream

    def leave(self) -> int:
        """Return the column at which pytest's line goes on above, 0 if it does not: something else was written."""
        above, self._above = self._above, None
        return above if above and above == self._writer.width_of_current_line else 0

    @contextmanager
    def _uncaptured(self) -> Iterator[TextIO]:
        with self._capture.global_and_fixture_disabled() if self._capture is not None else nullcontext():
            yield sys.stdout
            sys.stdout.flush()

    def _end_line(self) -> None:
        self._reporter.ensure_newline()
        if self._writer.width_of_current_line:  # the reporter does not count xdist's dots as an open line
            self._writer.line()


def progress_for(config: pytest.Config) -> Progress:
    """Return the display that fits: live on a terminal, plain lines elsewhere, none with `-q` or `-p no:terminal`.

    A dumb terminal gets plain lines, because it cannot redraw a line. With `-s`, tests write to the terminal, too, so
    pytest's line cannot be found again: the live line ends it.
    """
    reporter = config.pluginmanager.get_plugin("terminalreporter")
    if reporter is None or config.getoption("verbose") < 0:
        return Progress()
    capture = config.pluginmanager.get_plugin("capturemanager")
    terminal = Terminal(reporter, capture, config.get_terminal_writer())
    if not is_terminal(reporter) or os.environ.get("TERM") in _DUMB:
        return PlainProgress(terminal.at_line_start)
    if capture is None or config.getoption("capture") == "no":
        return LiveProgress(terminal.at_line_start)
    return LiveProgress(terminal.below, leave=terminal.leave, lines=terminal.at_line_start)


def is_terminal(reporter: Any) -> bool:
    """Return whether `reporter` writes to a terminal; False when another plugin's reporter has no `isatty`."""
    return bool(getattr(reporter, "isatty", False))
