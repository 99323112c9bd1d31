"""Ctrl-C pressed twice: the run still ends with its reports, and no process is left behind."""

from __future__ import annotations

import contextlib
import signal
from collections.abc import Callable
from types import FrameType
from typing import Any

import pytest


class InterruptPlugin:
    """Ignores the second Ctrl-C of a run; the third interrupts as ever.

    After the first Ctrl-C the run ends within seconds, because its processes are killed. A second Ctrl-C during that
    time would end pytest with its own traceback, another exit code and no summary. A SIGINT that is ignored (as in the
    background jobs of a shell, or under `nohup` with `trap ""`) stays ignored: nobody can press Ctrl-C there.
    """

    def __init__(self) -> None:
        self._before: Callable[[int, FrameType | None], Any] | int | None = None

    @pytest.hookimpl(tryfirst=True)
    def pytest_keyboard_interrupt(self) -> None:
        """Ignore the next Ctrl-C while pytest stops."""
        with contextlib.suppress(ValueError):  # signals belong to the main thread
            if self._before is None and signal.getsignal(signal.SIGINT) is not signal.SIG_IGN:
                self._before = signal.signal(signal.SIGINT, self._again)

    @pytest.hookimpl(trylast=True)
    def pytest_unconfigure(self) -> None:
        """Restore the earlier SIGINT handler."""
        with contextlib.suppress(ValueError, TypeError):
            if self._before is not None:
                signal.signal(signal.SIGINT, self._before)
                self._before = None

    def _again(self, number: int, frame: FrameType | None) -> None:
        signal.signal(signal.SIGINT, signal.default_int_handler)
