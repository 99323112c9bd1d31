"""Read files of results, of unknown origin, and show their text in messages."""

from __future__ import annotations

import math
from pathlib import Path

from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.store import json_reader

_SHOWN_CHARACTERS = 120


def read_json(path: Path) -> object:
    """Return the value in a JSON file. Raises `UsageError` as `json_reader` does, also for what is no file."""
    name = printable(str(path))
    if not path.is_file():  # a pipe would wait for ever
        raise UsageError(f"there is no file {name}.")
    return json_reader.read_json(path, name=name)


def is_empty(path: Path) -> bool:
    """Return True for an empty file: the evaluator empties its file at the start and died before the first write."""
    try:
        return path.is_file() and not path.read_bytes().strip()
    except OSError:
        return False  # read_json reports the error


def finite(value: object) -> float | None:
    """Return `value` as a float, or None for anything but a finite number (True and False are no numbers)."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return None
    try:
        number = float(value)
    except OverflowError:
        return None
    return number if math.isfinite(number) else None


def printable(text: object, *, quotes: bool = True) -> str:
    """Return foreign text for a message: one line that every terminal can print, cut when it is long."""
    try:
        plain = str(text) if isinstance(text, (str, int, float, Path)) else type(text).__name__
    except ValueError:  # Python refuses to write whole numbers of thousands of digits
        plain = "a huge number"
    if len(plain) > _SHOWN_CHARACTERS:
        plain = plain[: _SHOWN_CHARACTERS - 3] + "..."
    safe = "".join(char if char.isprintable() else f"\\u{ord(char):04x}" for char in plain)
    return f"'{safe}'" if quotes else safe
