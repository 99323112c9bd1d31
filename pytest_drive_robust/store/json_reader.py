"""Reads JSON of unknown origin: any bytes are read whole or refused with one sentence."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, NoReturn

from pytest_drive_robust.errors import UsageError

_LARGEST_BYTES = 1 << 30


def read_json(path: Path, *, name: str) -> Any:
    """Return the value in a JSON file, which messages call `name`, such as `"the run 'before.json'"`.

    Raises `UsageError` for a file that is larger than 1 GiB or no JSON, also for NaN, infinity, brackets that are
    nested too deeply, and an object with a repeated key.
    """
    try:
        if path.stat().st_size > _LARGEST_BYTES:
            raise UsageError(f"{name} is larger than 1 GiB, so it is not read.")
        text = path.read_bytes().decode("utf-8")
        return json.loads(text, object_pairs_hook=_without_twins, parse_constant=_refuse)
    except OSError as error:
        raise UsageError(f"{name} cannot be read: {error.strerror}.") from None
    except RecursionError:
        raise UsageError(f"{name} is not valid JSON: it is nested too deeply.") from None
    except ValueError as error:
        raise UsageError(f"{name} is not valid JSON: {error}.") from None


def _refuse(constant: str) -> NoReturn:
    """Raise `ValueError` for NaN and infinity, which Python's parser takes for numbers."""
    raise ValueError(f"{constant} is not a number in JSON")


def _without_twins(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Return a JSON object as a dictionary. Raises `ValueError` for a repeated key, whose last value would win.

    After a git merge that kept both sides of a conflict, each changed route of a baseline occurs twice, with the old
    and the new score.
    """
    found = dict(pairs)
    if len(found) < len(pairs):
        keys = [key for key, _ in pairs]
        twice = next(key for key in keys if keys.count(key) > 1)
        raise ValueError(f"{twice[:60]!r} stands there twice, as after a merge that kept both sides: remove one")
    return found
