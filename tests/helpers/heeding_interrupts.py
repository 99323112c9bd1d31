"""Processes that hear Ctrl-C, also when the tests were started in the background, where shells have it ignored."""

from __future__ import annotations

import signal


def heed_interrupts() -> None:
    """Take SIGINT as a process at a terminal does: give it as `preexec_fn`, Python then raises KeyboardInterrupt."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
