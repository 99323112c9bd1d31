"""The types of severities: a number or word has the type of its field's default."""

from __future__ import annotations

import contextlib
import numbers
from collections.abc import Mapping
from enum import Enum

from pytest_drive_robust.perturbations.sentence_forms import Spoken, defaults_of


def retyped(cls: type[Spoken], values: Mapping[str, object]) -> dict[str, object]:
    """Return the values that are not of their field's type, in the type of the field's default.

    A sentence, and so the key of an episode, tells no types: `2` and `2.0` are one number, but `pixels * 2` may wrap
    around, and `range(2.0)` is an error. A field without a default has the type of its `example`.
    """
    defaults = {name: value for name, value in defaults_of(cls).items() if value is not None}
    usual, found = {**cls.example, **defaults}, {}
    for name, value in values.items():
        with contextlib.suppress(OverflowError, ValueError):  # no such number or member: the class may refuse it
            typed = _as_type(type(usual.get(name)), value)
            if type(typed) is not type(value):
                found[name] = typed
    return found


def _as_type(kind: type, value: object) -> object:
    """Return a number or word as a float, a whole number or a member of the enumeration `kind`, else `value` itself."""
    if isinstance(value, str) and issubclass(kind, Enum):
        return kind(value)
    if not isinstance(value, numbers.Real) or isinstance(value, bool):
        return value
    is_exact = kind is float or issubclass(kind, Enum) or (kind is int and float(value).is_integer())
    return kind(value) if is_exact else value
