"""Ends calls of an agent that take too long, by signals: only in the main thread, and not on Windows.

A process has one timer: the timer of an outer call, or of pytest-timeout, goes on afterwards.
"""

from __future__ import annotations

import functools
import signal
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Any, TypeVar

_A = TypeVar("_A")
_CALLS = ("sensors", "reset", "act", "act_batch", "plan")
_AGAIN_S = 1.0
"""Seconds until the next interrupt, for code that catches every exception."""
_AT_ONCE_S = 1e-6
_LONGEST_S = 3e7
"""A year. A timer of macOS takes three, one of Linux many."""


class _TimeIsUpError(SystemExit):
    """Ends a call; a `SystemExit`, because the `except Exception` of an agent does not catch it."""


def with_time_limit(agent: _A, limit_s: float) -> _A:
    """Return the agent; its calls raise `TimeoutError` after `limit_s` seconds.

    The agent stays as it is outside of the main thread, on Windows, and where its attributes cannot be set.
    """
    if threading.current_thread() is threading.main_thread() and hasattr(signal, "setitimer"):
        for name in _CALLS:
            call = getattr(agent, name, None)
            if callable(call):
                with suppress(AttributeError):  # of a class with slots
                    setattr(agent, name, _limited(call, limit_s))
    return agent


def _limited(call: Callable[..., Any], limit_s: float) -> Callable[..., Any]:
    @functools.wraps(call)
    def limited(*given: Any) -> Any:
        before = signal.signal(signal.SIGALRM, _end)
        started_s = time.monotonic()
        left_s, again_s = signal.setitimer(signal.ITIMER_REAL, min(limit_s, _LONGEST_S), _AGAIN_S)
        try:
            return call(*given)
        except _TimeIsUpError as error:
            told = f"the call takes more than {limit_s:g} s"
            raise TimeoutError(told).with_traceback(error.__traceback__) from None  # with the line that it was at
        finally:
            signal.setitimer(signal.ITIMER_REAL, 0.0)
            signal.signal(signal.SIGALRM, before)
            if left_s > 0.0:
                left_s -= time.monotonic() - started_s
                signal.setitimer(signal.ITIMER_REAL, max(left_s, _AT_ONCE_S), again_s)

    return limited


def _end(*_: object) -> None:
    raise _TimeIsUpError
