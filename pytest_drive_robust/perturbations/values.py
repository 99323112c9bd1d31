"""Severities as text and back: `0.2`, `hold`, `true`, `0.12/0.3`."""

from __future__ import annotations

import contextlib
import dataclasses
import json
import numbers
import re
import types
import typing
import weakref

from pytest_drive_robust.errors import PerturbationError

__all__ = ["field_types", "is_number_type", "parse_value", "render_value", "split_outside_quotes"]

_QUOTED = re.compile(r'"(?:[^"\\]|\\.)*"')
_WORD = re.compile(r"[A-Za-z_][\w.+-]*", re.ASCII)
_CONSTANTS = {"true": True, "false": False, "none": None}
_RESERVED = {*_CONSTANTS, "nan", "inf", "infinity"}

_FIELD_TYPES: weakref.WeakKeyDictionary[type, dict[str, object]] = weakref.WeakKeyDictionary()
"""Resolving annotations is slow, and a suite may hold thousands of sentences."""


def render_value(value: object) -> str:
    """Return the text of a severity: shortest exact number, bare word or JSON string, tuples with slashes.

    >>> render_value(200.0), render_value("hold"), render_value((0.12, 0.3)), render_value((0.12,))
    ('200', 'hold', '0.12/0.3', '0.12/')
    """
    if value is None or isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, numbers.Integral):
        return str(int(value))
    if isinstance(value, numbers.Real):
        return repr(float(value)).removesuffix(".0")
    if isinstance(value, str):
        return str(value) if _WORD.fullmatch(value) and value.lower() not in _RESERVED else json.dumps(value)
    if isinstance(value, (tuple, list)) and not any(isinstance(item, (tuple, list)) for item in value):
        return "/".join(map(render_value, value)) + ("/" if len(value) < 2 else "")
    raise PerturbationError(
        f"a severity is {value!r}, expected a number, a string, True, False, None or a tuple of those: "
        "only these have a sentence form"
    )


def parse_value(text: str, kind: object) -> object:
    """Return the inverse of `render_value` for a field of type `kind` (`object` when unknown). Raises `ValueError`."""
    origin = typing.get_origin(kind) or kind
    if origin in (types.UnionType, typing.Union):
        return _first_that_fits(text, typing.get_args(kind))
    if origin is typing.Literal:
        return next((choice for choice in typing.get_args(kind) if render_value(choice) == text), text)
    if origin in (tuple, list):
        return _sequence(text, typing.get_args(kind), as_list=origin is list)
    if kind is float:
        return float(text)
    if kind is int:
        return _whole(text)
    if kind is str:
        return json.loads(text) if text.startswith('"') else text
    if kind in (bool, type(None)):
        constant = _CONSTANTS.get(text.lower(), text)
        if type(constant) is not kind:
            raise ValueError(text)
        return constant
    return _guessed(text)


def field_types(cls: type) -> dict[str, object]:
    """Return the type of each field that the constructor takes; `object` where the annotation does not resolve."""
    if cls in _FIELD_TYPES:
        return dict(_FIELD_TYPES[cls])
    try:
        hints = typing.get_type_hints(cls)
    except (NameError, TypeError, AttributeError):  # a class made inside a function, or under TYPE_CHECKING
        hints = {}
    if not dataclasses.is_dataclass(cls):
        return {}
    types = {field.name: hints.get(field.name, object) for field in dataclasses.fields(cls) if field.init}
    if hints and "__dataclass_fields__" in vars(cls):  # nothing about it can change any more
        _FIELD_TYPES[cls] = types
    return dict(types)


def is_number_type(kind: object) -> bool:
    """Return True for `int`, `float` and unions of them with None."""
    arguments = typing.get_args(kind) or (kind,)
    return all(argument in (int, float, type(None)) for argument in arguments)


def split_outside_quotes(text: str, separator: str) -> list[str]:
    """Split as `re.split(separator, text)` does, ignoring case and not inside of JSON strings."""
    masked = _QUOTED.sub(lambda quoted: "\0" * len(quoted.group()), text)
    parts, start = [], 0
    for found in re.finditer(separator, masked, re.IGNORECASE):
        parts.append(text[start : found.start()])
        start = found.end()
    return [*parts, text[start:]]


def _whole(text: str) -> int:
    if text.lstrip("+-").isdecimal():
        return int(text)
    number = float(text)
    if not number.is_integer():
        raise ValueError(text)
    return int(number)


def _sequence(text: str, kinds: tuple[object, ...], *, as_list: bool) -> object:
    inner = [kind for kind in kinds if kind is not Ellipsis] or [object]
    items = [item for item in split_outside_quotes(text, "/") if item]
    values = [parse_value(item, inner[min(index, len(inner) - 1)]) for index, item in enumerate(items)]
    return values if as_list else tuple(values)


def _first_that_fits(text: str, kinds: tuple[object, ...]) -> object:
    """Return the value as one of several types, the narrow ones first: None, bool, int, float, then the others."""
    narrow: list[object] = [type(None), bool, int, float]
    for kind in sorted(kinds, key=lambda kind: narrow.index(kind) if kind in narrow else len(narrow)):
        with contextlib.suppress(ValueError):
            return parse_value(text, kind)
    raise ValueError(text)


def _guessed(text: str) -> object:
    """Return a value whose type nobody told: what `render_value` would have written so."""
    parts = split_outside_quotes(text, "/")
    if len(parts) > 1:
        return tuple(_guessed(part) for part in parts if part)
    if text.startswith('"'):
        return json.loads(text)
    if text.lower() in _CONSTANTS:
        return _CONSTANTS[text.lower()]
    for number in (int, float):
        with contextlib.suppress(ValueError):
            return number(text)
    return text
