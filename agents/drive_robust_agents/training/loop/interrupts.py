"""Ctrl-C and SIGTERM while a training runs: heeded between two steps, where its state is whole."""

from __future__ import annotations

import signal
import threading
from types import FrameType, TracebackType

__all__ = ["Interrupts"]

_SIGNALS = (signal.SIGINT, signal.SIGTERM)


class Interrupts:
    """Notes the first signal, for `heed` to raise; the second one raises KeyboardInterrupt wherever it strikes.

    As a context it holds back signals until it is left. Only the main thread is given signals: in another one nothing
    is held back.
    """

    def __init__(self) -> None:
        self._struck = False

    def heed(self) -> None:
        """Raise KeyboardInterrupt when a signal came."""
        if self._struck:
            raise KeyboardInterrupt

    def __enter__(self) -> Interrupts:
        main = threading.current_thread() is threading.main_thread()
        self._before = {number: signal.signal(number, self._note) for number in _SIGNALS} if main else {}
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for number, handler in self._before.items():
            # None: installed by no Python code, which cannot be put back
            signal.signal(number, signal.SIG_DFL if handler is None else handler)
        if kind is None:
            self.heed()

    def _note(self, number: int, frame: FrameType | None) -> None:
        self.heed()
        self._struck = True
