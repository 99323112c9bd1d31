"""Values as one text for digests: equal values give equal text in every process, `5` and `5.0` are one number."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping
from enum import Enum
from os import PathLike, fspath
from typing import Any

__all__ = ["canonical_text", "digest_of"]

_DIGEST_BYTES = 16


def digest_of(*values: object) -> str:
    """Return 32 hex digits of these values. Raises `TypeError` as `canonical_text` does."""
    return hashlib.blake2b(canonical_text(values).encode("ascii"), digest_size=_DIGEST_BYTES).hexdigest()


def canonical_text(value: object) -> str:
    """Return `value` as JSON with sorted keys; dataclasses by their fields, enum members by their value.

    Raises `TypeError` for anything that has no value of its own to compare, such as an object or a function.
    """
    return json.dumps(_plain(value), separators=(",", ":"), sort_keys=True)


def _plain(value: Any) -> Any:
    if value is None or (isinstance(value, (bool, str)) and not isinstance(value, Enum)):
        return value
    if isinstance(value, Enum):
        return _plain(value.value)
    if isinstance(value, (int, float)):
        return _number(value)
    if isinstance(value, Mapping):
        return {"map": sorted((canonical_text(name), _plain(item)) for name, item in value.items())}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    if isinstance(value, (set, frozenset)):
        return {"set": sorted(canonical_text(item) for item in value)}
    if isinstance(value, bytes):
        return {"bytes": value.hex()}
    if isinstance(value, PathLike):
        return {"path": _plain(fspath(value))}
    fields = getattr(type(value), "__dataclass_fields__", None)
    if fields is not None:
        return {type(value).__name__: [[name, _plain(getattr(value, name))] for name in fields]}
    if getattr(value, "ndim", None) == 0 and hasattr(value, "item"):  # a scalar of numpy
        return _plain(value.item())
    raise TypeError(f"{type(value).__name__} has no content that could be compared")


def _number(value: int | float) -> Any:
    """Return whole numbers without a fraction, minus zero as zero, what JSON cannot write by name."""
    if isinstance(value, float):
        if not math.isfinite(value):
            return {"number": str(value)}
        return int(value) if value.is_integer() else value
    return int(value)
