"""The kinds of messages between a child process and the one that asks."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pytest_drive_robust.errors import UsageError

__all__ = ["ALONE", "CHECK", "DRIVE", "REFUSED", "RESULT", "SALVAGE", "TOGETHER", "refusal_bytes"]

DRIVE, SALVAGE, RESULT, REFUSED = b"D", b"S", b"R", b"U"
CHECK, ALONE, TOGETHER = b"C", b"A", b"T"
"""About lockstep: whether an agent may, an episode in a batch of its own, an episode that shares its batch."""


def refusal_bytes(error: UsageError) -> bytes:
    """Why something cannot be driven at all, on its way to the other side."""
    return json.dumps({"type": type(error).__name__, "text": str(error)}).encode()
