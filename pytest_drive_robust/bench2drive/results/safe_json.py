"""Read JSON of unknown origin: any bytes are read whole or refused with one sentence."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import NoReturn

from pytest_drive_robust.errors import UsageError

_LARGEST_BYTES = 1 << 30
_SHOWN_CHARACTERS = 120


def read_json(path: Path) -> object:
    """Return the value in a JSON file. Raises `UsageError` for a file that is no JSON, also for NaN and Infinity."""
    name = printable(str(path))
    if not path.is_file():  # a pipe would wait for ever
        raise UsageError(f"there is no file {name}.")
    try:
        if path.stat().st_size > _LARGEST_BYTES:
            raise UsageError(f"{name} is larger than 1 GiB: it is not a file of results.")
        return json.loads(path.read_bytes().decode("utf-8"), parse_constant=_refuse)
    except OSError as error:
        raise UsageError(f"{name} cannot be read: {error.strerror}.") from None
    except RecursionError:
        raise UsageError(f"{name} is not a file of results: it is nested too deeply.") from None
    except ValueError as error:
        raise UsageError(f"{name} is not valid JSON: {printable(str(error), quotes=False)}.") from None


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


def _refuse(constant: str) -> NoReturn:
    raise ValueError(f"{constant} is not a number in JSON")
