"""Finds the first place of a JSON document that does not fit the document's published schema.

The schemas lie in `report/schema/`. Of JSON Schema this module knows what they use: types, `const`, `enum`, bounds,
`required`, and rules for the parts of objects and lists.
"""

from __future__ import annotations

import functools
import json
import math
import sys
from collections.abc import Callable, Collection, Mapping
from pathlib import Path
from typing import Any

_FOLDER = Path(__file__).parents[1] / "report" / "schema"
_MOST_CHARACTERS = 60
_TYPES: Mapping[str, tuple[str, Callable[[Any], bool]]] = {
    "object": ("an object", lambda value: isinstance(value, dict)),
    "array": ("a list", lambda value: isinstance(value, list)),
    "string": ("text", lambda value: isinstance(value, str)),
    "boolean": ("true or false", lambda value: isinstance(value, bool)),
    "null": ("null", lambda value: value is None),
    "integer": ("a whole number", lambda value: type(value) is int),
    "number": ("a number", lambda value: type(value) in (int, float) and abs(value) <= sys.float_info.max),
}
"""By the name of a type in a schema: its name in messages, and whether a value has the type."""

_Found = tuple[str, str]  # the place below the value, as ".seeds[0]", and what is wrong there


def misfit(document: object, schema: str, *, may_lack: Mapping[str, Collection[str]] = {}) -> str:
    """Return the first place of a document that does not fit, and why, or `""` for a document that fits.

    `schema` names the schema, such as `"run"`. `may_lack` holds the keys that an object may lack although the schema
    asks for them, by the name of the object's rule in the schema, `""` for the whole document. Keys that the schema
    does not name are not looked at.

    `'episodes[3].driving_score is "high", expected a number from 0 to 100 or null'`
    """
    whole = _schema(schema)
    found = _Check(whole.get("$defs", {}), may_lack).misfit(document, whole, "")
    return "" if found is None else f"{found[0].removeprefix('.') or 'it'} {found[1]}"


@functools.cache
def _schema(name: str) -> dict[str, Any]:
    text = (_FOLDER / f"{name}.schema.json").read_text(encoding="utf-8")
    schema: dict[str, Any] = json.loads(text)
    return schema


class _Check:
    """Compares values with the rules of one schema, whose named rules are `named`."""

    def __init__(self, named: Mapping[str, Any], may_lack: Mapping[str, Collection[str]]) -> None:
        self._named = named
        self._may_lack = may_lack

    def misfit(self, value: object, rule: Mapping[str, Any], name: str = "-") -> _Found | None:
        """Return the first misfit of a value, or None when the value fits the rule; `name` is that of the rule."""
        if "anyOf" in rule:  # an object or null, in every schema of ours
            return None if value is None else self.misfit(value, rule["anyOf"][0])
        if "$ref" in rule:
            named = rule["$ref"].rpartition("/")[2]
            return self.misfit(value, self._named[named], named)
        if not _fits(value, rule):
            return "", f"is {_shown(value)}, expected {_expected(rule)}"
        if isinstance(value, dict):
            lacks = [key for key in rule.get("required", ()) if key not in value]
            missing = [key for key in lacks if key not in self._may_lack.get(name, ())]
            return ("", f"lacks {missing[0]!r}") if missing else self._misfit_in_object(value, rule)
        return self._misfit_in_list(value, rule) if isinstance(value, list) and "items" in rule else None

    def _misfit_in_object(self, value: Mapping[str, Any], rule: Mapping[str, Any]) -> _Found | None:
        known, others = rule.get("properties", {}), rule.get("additionalProperties")
        for name, item in value.items():
            of_item = known.get(name, others)
            if of_item is not None and (found := self.misfit(item, of_item)) is not None:
                place = f".{name}" if name in known else f"[{json.dumps(name)}]"
                return place + found[0], found[1]
        return None

    def _misfit_in_list(self, values: list[Any], rule: Mapping[str, Any]) -> _Found | None:
        for number, item in enumerate(values):
            if (found := self.misfit(item, rule["items"])) is not None:
                return f"[{number}]{found[0]}", found[1]
        return None


def _fits(value: Any, rule: Mapping[str, Any]) -> bool:
    """Return whether the value itself fits, whatever its parts are."""
    if "const" in rule or "enum" in rule:
        return value in rule.get("enum", [rule.get("const")])
    kinds = _kinds(rule)
    if kinds and not any(_TYPES[kind][1](value) for kind in kinds):
        return False
    if isinstance(value, list):
        return bool(rule.get("minItems", 0) <= len(value) <= rule.get("maxItems", math.inf))
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        return bool(rule.get("minimum", -math.inf) <= value <= rule.get("maximum", math.inf))
    return True


def _kinds(rule: Mapping[str, Any]) -> list[str]:
    kinds: str | list[str] = rule.get("type", [])
    return [kinds] if isinstance(kinds, str) else kinds


def _expected(rule: Mapping[str, Any]) -> str:
    """Return in words what a rule expects: `"a number from 0 to 100 or null"`."""
    if "const" in rule or "enum" in rule:
        return f"one of {', '.join(map(_shown, rule.get('enum', [rule.get('const')])))}"
    return " or ".join(_TYPES[kind][0] + _bounds(kind, rule) for kind in _kinds(rule))


def _bounds(kind: str, rule: Mapping[str, Any]) -> str:
    if kind == "array" and "minItems" in rule:
        return f" of {rule['minItems']}" + ("" if rule.get("maxItems") == rule["minItems"] else " or more")
    if kind in ("integer", "number") and "minimum" in rule:
        return (
            f" from {rule['minimum']} to {rule['maximum']}" if "maximum" in rule else f" of {rule['minimum']} or more"
        )
    return ""


def _shown(value: object) -> str:
    text = json.dumps(value)
    return text if len(text) <= _MOST_CHARACTERS else f"{text[:_MOST_CHARACTERS]}..."
