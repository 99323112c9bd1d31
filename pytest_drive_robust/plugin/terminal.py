"""The terminal behind pytest's capturing, and the progress display that fits it."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from typing import Any, TextIO

from pytest_drive_robust.report.progress import LiveProgress, PlainProgress, Progress


class UncapturedScreen:
    """Writes where pytest itself writes, also while a test runs and its output is captured.

    `reporter` is pytest's terminal reporter, `capture` its capture manager (None under `-p no:capture`).
    """

    def __init__(self, reporter: Any, capture: Any, *, writer: Any) -> None:
        self._reporter = reporter
        self._capture = capture
        self._writer = writer

    @contextmanager
    def exclusive(self) -> Iterator[TextIO]:
        """Yield the real standard output, at the start of a line, with capturing suspended."""
        suspended = self._capture.global_and_fixture_disabled() if self._capture is not None else nullcontext()
        with suspended:
            self._reporter.ensure_newline()
            if self._writer.width_of_current_line:  # xdist's dots: the reporter does not count them as a line begun
                self._writer.line()
            yield sys.stdout
            sys.stdout.flush()


def progress_for(config: Any) -> Progress:
    """Return the display that fits: live on a terminal, plain lines elsewhere, none with `-q` or `-p no:terminal`."""
    reporter = config.pluginmanager.getplugin("terminalreporter")
    if reporter is None or config.getoption("verbose") < 0:
        return Progress()
    capture = config.pluginmanager.getplugin("capturemanager")
    screen = UncapturedScreen(reporter, capture, writer=config.get_terminal_writer())
    return LiveProgress(screen) if reporter.isatty else PlainProgress(screen)
