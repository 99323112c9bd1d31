"""Writes to the terminal past pytest's capturing, and chooses the progress display for that terminal."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from functools import partial
from typing import Any, TextIO

import pytest

from pytest_drive_robust.report.progress import LiveProgress, PlainProgress, Progress

_DUMB = ("dumb", "unknown")
"""Values of `TERM` for terminals that cannot move the cursor; `rich`, which draws, has the same two."""


@contextmanager
def uncaptured_screen(reporter: Any, capture: Any, writer: Any) -> Iterator[TextIO]:
    """Yield the real standard output, where pytest itself writes, at the start of a line, with capturing suspended.

    `reporter` is pytest's terminal reporter, `capture` its capture manager (None under `-p no:capture`).
    """
    with capture.global_and_fixture_disabled() if capture is not None else nullcontext():
        reporter.ensure_newline()
        if writer.width_of_current_line:  # the reporter does not count xdist's dots as an open line
            writer.line()
        yield sys.stdout
        sys.stdout.flush()


def progress_for(config: pytest.Config) -> Progress:
    """Return the display that fits: live on a terminal, plain lines elsewhere, none with `-q` or `-p no:terminal`.

    A dumb terminal gets plain lines, because it cannot redraw a line.
    """
    reporter = config.pluginmanager.get_plugin("terminalreporter")
    if reporter is None or config.getoption("verbose") < 0:
        return Progress()
    capture = config.pluginmanager.get_plugin("capturemanager")
    screen = partial(uncaptured_screen, reporter, capture, config.get_terminal_writer())
    draws = is_terminal(reporter) and os.environ.get("TERM") not in _DUMB
    return LiveProgress(screen) if draws else PlainProgress(screen)


def is_terminal(reporter: Any) -> bool:
    """Return whether `reporter` writes to a terminal; False when another plugin's reporter has no `isatty`."""
    return bool(getattr(reporter, "isatty", False))
