"""Turns `os._exit` of an agent's code into an exception where that code runs in the process of a command or test run.

With `os._exit(0)` an agent would end the process with exit code 0, which CI takes for a pass. Worker processes do
without: their supervisor sees the exit.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import NoReturn


@contextmanager
def exits_raised() -> Iterator[None]:
    """Let `os._exit` raise `SystemExit` while the body runs, as `sys.exit` does: the caller blames the code for it.

    In another thread an exception would be lost, so the process ends there, never with exit code 0. A sub-process that
    the code has forked ends as ever.
    """
    leave, process, thread = os._exit, os.getpid(), threading.get_ident()

    def raise_exit(status: int) -> NoReturn:
        if os.getpid() != process:
            leave(status)
        if threading.get_ident() != thread:
            os.write(2, f"a thread of the agent, or of what it uses, called os._exit({status}).\n".encode())
            leave(status or 1)
        raise SystemExit(f"os._exit({status})")

    os._exit = raise_exit
    try:
        yield
    finally:
        os._exit = leave
