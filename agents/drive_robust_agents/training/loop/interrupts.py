"""Handle Ctrl-C and SIGTERM during a training between two steps, where its state is complete."""

from __future__ import annotations

import signal
import threading
from types import FrameType, TracebackType

__all__ = ["Interrupts"]

_SIGNALS = (signal.SIGINT, signal.SIGTERM)


class Interrupts:
    """Records the first signal, for `heed` to raise; the second signal raises KeyboardInterrupt at once.

    Used as a context manager, which defers signals until its exit. Only the main thread receives signals; in other
    threads the context does nothing.
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
            # None: the handler was not installed by Python code and cannot be restored
            signal.signal(number, signal.SIG_DFL if handler is None else handler)
        if kind is None:
            self.heed()

    def _note(self, number: int, frame: FrameType | None) -> None:
        self.heed()
        self._struck = True
