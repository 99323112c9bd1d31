"""Values of severities as text and back: `200.0` is `"200"`, `(0.12, 0.3)` is `"0.12/0.3"`."""

from __future__ import annotations

import contextlib
import json
import numbers
import re

from pytest_drive_robust.errors import PerturbationError

_QUOTED = re.compile(r'"(?:[^"\\]|\\.)*"')
_WORD = re.compile(r"[A-Za-z_][\w.+-]*", re.ASCII)
_CONSTANTS = {"true": True, "false": False, "none": None}
_RESERVED = {*_CONSTANTS, "nan", "inf", "infinity"}


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
        word = str.__str__(value)  # `str()` of an enumeration's member is the name of the member
        return word if _WORD.fullmatch(word) and word.lower() not in _RESERVED else json.dumps(word)
    if isinstance(value, tuple) and not any(isinstance(item, tuple) for item in value):
        return "/".join(map(render_value, value)) + ("/" if len(value) < 2 else "")
    raise PerturbationError(
        f"a severity is {value!r}, expected a number, a string, True, False, None or a tuple of those: "
        "only these have a sentence form"
    )


def parse_value(text: str) -> object:
    """Return the value of a text, the inverse of `render_value`; a text of no other form is a string."""
    parts = split_outside_quotes(text, "/")
    if len(parts) > 1:
        return tuple(parse_value(part) for part in parts if part)
    if text.lower() in _CONSTANTS:
        return _CONSTANTS[text.lower()]
    for read in (json.loads,) if text.startswith('"') else (int, float):
        with contextlib.suppress(ValueError):
            return -0.0 if text == "-0" else read(text)
    return text


def split_outside_quotes(text: str, separator: str) -> list[str]:
    """Split as `re.split(separator, text)` does, in any case, but not inside of JSON strings."""
    masked = _QUOTED.sub(lambda quoted: "\0" * len(quoted.group()), text)
    parts, start = [], 0
    for found in re.finditer(separator, masked, re.IGNORECASE):
        parts.append(text[start : found.start()])
        start = found.end()
    return [*parts, text[start:]]
