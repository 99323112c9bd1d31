"""Finds a place of a JSON document that does not fit the document's schema, a published one of `report/schema/`."""

from __future__ import annotations

import functools
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

_FOLDER = Path(__file__).parents[1] / "report" / "schema"
_MOST_CHARACTERS = 60
_WHOLE = "data"  # what fastjsonschema calls the document

_Check = tuple[Callable[[object], object], Any]
MayLack = tuple[tuple[str, tuple[str, ...]], ...]
"""Names of rules in a schema, `""` for the whole document, each with keys that an object of this rule may lack."""


def misfit(document: object, schema: str, *, may_lack: MayLack = ()) -> str:
    """Return the first place of a document that does not fit, and why, or `""` for a document that fits.

    `schema` names the schema, such as `"run"`. Keys that the schema does not name are not looked at. Numbers must be
    finite: read the document with `store.json_reader`.

    `'episodes[3].driving_score must be number or null, not "high"'`
    """
    return _found_by(_check_of(schema, may_lack), document)


def misfit_of(document: object, schema: dict[str, Any]) -> str:
    """Return what `misfit` returns, by a schema that is not published."""
    return _found_by(_compiled(schema), document)


def _found_by(check: _Check, document: object) -> str:
    find, misfit_error = check
    try:
        find(document)
    except misfit_error as error:
        return _told(error)
    return ""


@functools.cache
def _check_of(name: str, may_lack: MayLack) -> _Check:
    schema: dict[str, Any] = json.loads((_FOLDER / f"{name}.schema.json").read_text(encoding="utf-8"))
    for rule, keys in may_lack:
        part = schema["$defs"][rule] if rule else schema
        part["required"] = [key for key in part["required"] if key not in keys]
    return _compiled(schema)


def _compiled(schema: dict[str, Any]) -> _Check:
    """Return what checks a document, and the error that it raises: a nested session imports that library anew."""
    import fastjsonschema

    return fastjsonschema.compile(schema), fastjsonschema.JsonSchemaValueException


def _told(error: Any) -> str:
    """Return the place of the schema checker's error, and what is wrong there."""
    name = str(error.name)
    place = name.removeprefix(_WHOLE).removeprefix(".") or "the document"
    if error.rule == "required":
        return f"{place} lacks {next(key for key in error.rule_definition if key not in error.value)!r}"
    return f"{place}{error.message.removeprefix(name)}, not {_shown(error.value)}"


def _shown(value: object) -> str:
    """Return the beginning of a value as JSON; only the kind of one that was nested as deeply as could just be read."""
    try:
        text = json.dumps(value)
    except RecursionError:
        return f"a deeply nested {'object' if isinstance(value, dict) else 'array'}"
    return text if len(text) <= _MOST_CHARACTERS else f"{text[:_MOST_CHARACTERS]}..."
