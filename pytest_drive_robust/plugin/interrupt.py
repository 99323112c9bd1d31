"""Ctrl-C, pressed again by somebody who cannot wait: the run ends as it would have, and nothing is left behind."""

from __future__ import annotations

import contextlib
import signal
from types import FrameType

import pytest

__all__ = ["StopPlugin"]


class StopPlugin:
    """After the first Ctrl-C the run is ending already, within seconds because its processes are killed. A second one
    in the middle of that would end pytest with a traceback of its own, another exit code and no summary: it is left
    out. A third one interrupts as ever.
    """

    def __init__(self) -> None:
        self._before: object = None

    @pytest.hookimpl(tryfirst=True)
    def pytest_keyboard_interrupt(self) -> None:
        """pytest begins to stop."""
        with contextlib.suppress(ValueError):  # signals belong to the main thread
            if self._before is None:
                self._before = signal.signal(signal.SIGINT, self._again)

    @pytest.hookimpl(trylast=True)
    def pytest_unconfigure(self) -> None:
        """pytest has stopped."""
        with contextlib.suppress(ValueError, TypeError):
            if self._before is not None:
                signal.signal(signal.SIGINT, self._before)  # type: ignore[arg-type]
                self._before = None

    def _again(self, number: int, frame: FrameType | None) -> None:
        signal.signal(signal.SIGINT, signal.default_int_handler)
