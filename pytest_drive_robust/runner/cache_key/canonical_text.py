"""Turns values into one text for digests: equal values give equal text in every process; `5` equals `5.0`."""

from __future__ import annotations

import functools
import hashlib
import json
import math
import os
import sys
from collections.abc import Callable, Mapping
from enum import Enum
from typing import Any

_OWN = __name__.partition(".")[0]
_ENCODER = json.JSONEncoder(separators=(",", ":"), sort_keys=True)


def digest_of(*values: object) -> str:
    """Return a digest of these values, 32 hex digits. Raises `TypeError` as `canonical_text` does."""
    return hashlib.blake2b(canonical_text(values).encode("ascii"), digest_size=16).hexdigest()


def canonical_text(value: object) -> str:
    """Return `value` as JSON with sorted keys; dataclasses by their fields, enum members by their value.

    Raises `TypeError` for anything without a comparable value, such as a plain object or a function.
    """
    return _ENCODER.encode(plain(value))


def plain(value: Any, otherwise: Callable[[Any], Any] | None = None) -> Any:
    """Return `value` as JSON types; `otherwise` converts objects without a comparable value, and users' classes."""
    if type(value) is str:
        return value
    content = _plain_content(value, otherwise)
    if otherwise is None or not _is_of_a_written_class(value):
        return content
    return {"content": content, "class": otherwise(type(value))}


def _is_of_a_written_class(value: Any) -> bool:
    """Return whether the value's class is a user's, so that its methods count: an enumeration or a dataclass, say."""
    cls = type(value)
    kinds = (Enum, Mapping, list, tuple, set, frozenset)
    if not isinstance(value, kinds) and not hasattr(cls, "__dataclass_fields__"):
        return False
    return "__module__" in vars(cls) and not is_ours_or_standard(cls)


def is_ours_or_standard(cls: type) -> bool:
    """Return whether a class is ours or of the standard library, so that other parts of the identity cover its code."""
    top = cls.__module__.partition(".")[0]
    return top == _OWN or top in sys.stdlib_module_names


def _plain_content(value: Any, otherwise: Callable[[Any], Any] | None) -> Any:
    inner = functools.partial(plain, otherwise=otherwise)
    if value is None or (isinstance(value, (bool, str)) and not isinstance(value, Enum)):
        return value
    if isinstance(value, Enum):
        return inner(value.value)
    if isinstance(value, float) and not math.isfinite(value):
        return {"number": str(value)}
    if isinstance(value, (int, float)):  # minus zero is zero
        return int(value) if value == int(value) else value
    if isinstance(value, Mapping):
        return {"map": sorted((json.dumps(inner(name)), inner(item)) for name, item in value.items())}
    if isinstance(value, (list, tuple)):
        return [inner(item) for item in value]
    if isinstance(value, (set, frozenset)):
        return {"set": sorted(json.dumps(inner(item)) for item in value)}
    if isinstance(value, bytes):
        return {"bytes": value.hex()}
    if isinstance(value, os.PathLike):
        return {"path": inner(os.fspath(value))}
    fields = getattr(type(value), "__dataclass_fields__", None)
    if fields is not None:  # the value of an `InitVar` is not kept
        return {type(value).__name__: [[name, inner(getattr(value, name))] for name in fields if hasattr(value, name)]}
    if getattr(value, "ndim", None) == 0 and hasattr(value, "item"):  # a scalar of numpy
        return inner(value.item())
    if otherwise is not None:
        return otherwise(value)
    raise TypeError(f"{type(value).__name__} has no content that could be compared")
