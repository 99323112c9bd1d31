"""Whether this system has what worker processes rest on. Asked before anything is imported that only some have."""

from __future__ import annotations

import importlib.util
import os

from pytest_drive_robust.errors import UsageError

INLINE = (
    "Give --drive-executor inline (drive_executor = inline): the same episodes to the bit, one after the other, "
    "without time-outs and memory limits. drive-robust replay and drive-robust report work here, too."
)
"""What one does instead, where an executor was asked for."""

_FUNCTIONS = ("fork", "killpg", "setsid")
_MODULES = ("fcntl", "resource")


def check_platform(asked: str, advice: str = INLINE) -> None:
    """Raise `UsageError` where no worker process can be had, as on Windows. `asked` is the option that needs them."""
    missing = [f"os.{name}" for name in _FUNCTIONS if not hasattr(os, name)]
    missing += [name for name in _MODULES if importlib.util.find_spec(name) is None]
    if missing:
        raise UsageError(
            f"{asked} needs worker processes, which there are on Linux, on macOS and in WSL: the Python of this system "
            f"has no {', '.join(missing)}. {advice}"
        )
