"""Says where an error was raised in the code of a user, for messages that stand in place of a traceback."""

from __future__ import annotations

import importlib
import os
import traceback
from pathlib import Path

from pytest_drive_robust.errors import from_here

_CALLERS = tuple(str(folder) + os.sep for folder in (Path(__file__).parents[1], Path(importlib.__file__).parent))
"""Our folder and that of importlib: their code calls that of a user."""


def raised_at(error: BaseException) -> str:
    """Return `" (my_agent.py:12)"`, the deepest line in the first file of a user; `""` when there is none."""
    frames = traceback.extract_tb(error.__traceback__)
    others = [frame for frame in frames if not frame.filename.startswith((*_CALLERS, "<"))]
    if not others:
        return ""
    frame = [frame for frame in others if frame.filename == others[0].filename][-1]
    return f" ({from_here(Path(frame.filename))}:{frame.lineno})"
