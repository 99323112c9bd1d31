"""Checks that this system supports worker processes, before the import of modules that some systems lack."""

from __future__ import annotations

import importlib.util
import os

from pytest_drive_robust.errors import UsageError

INLINE = (
    "Give --drive-executor inline (drive_executor = inline): the same episodes to the bit, one after the other, "
    "without time-outs and memory limits. drive-robust replay and drive-robust report work here, too."
)
"""Advice for a user who chose an executor of worker processes."""

_FUNCTIONS = ("fork", "killpg", "setsid")
_MODULES = ("fcntl", "resource")


def check_platform(asked: str, advice: str = INLINE) -> None:
    """Raise `UsageError` on a system without worker processes, such as Windows. `asked` is the user's option."""
    missing = [f"os.{name}" for name in _FUNCTIONS if not hasattr(os, name)]
    missing += [name for name in _MODULES if importlib.util.find_spec(name) is None]
    if missing:
        raise UsageError(
            f"{asked} needs worker processes, which there are on Linux, on macOS and in WSL: the Python of this system "
            f"has no {', '.join(missing)}. {advice}"
        )
