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

    After the first one the run ends within seconds, because its processes are killed. A second one in the middle of
    that would end pytest with a traceback of its own, another exit code and no summary. Where SIGINT is ignored (a
    shell starts background jobs so, and `nohup` with `trap ""`) it stays ignored: nobody can press Ctrl-C there.
    """

    def __init__(self) -> None:
        self._before: Callable[[int, FrameType | None], Any] | int | None = None

    @pytest.hookimpl(tryfirst=True)
    def pytest_keyboard_interrupt(self) -> None:
        """Watch for a second one while pytest stops."""
        with contextlib.suppress(ValueError):  # signals belong to the main thread
            if self._before is None and signal.getsignal(signal.SIGINT) is not signal.SIG_IGN:
                self._before = signal.signal(signal.SIGINT, self._again)

    @pytest.hookimpl(trylast=True)
    def pytest_unconfigure(self) -> None:
        """Put back the handler of before."""
        with contextlib.suppress(ValueError, TypeError):
            if self._before is not None:
                signal.signal(signal.SIGINT, self._before)
                self._before = None

    def _again(self, number: int, frame: FrameType | None) -> None:
        signal.signal(signal.SIGINT, signal.default_int_handler)
