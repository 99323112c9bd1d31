"""The objects of the JSON report, from its schema."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest_drive_robust as package
from reference_parts.rst import escaped, heading, list_table

_FILE = Path(package.__file__).parent / "report" / "schema" / "run.schema.json"


def schema() -> str:
    """Return every object of the JSON schema with its fields."""
    document = json.loads(_FILE.read_text(encoding="utf-8"))
    lines: list[str] = []
    for name, part in {"run": document, **document["$defs"]}.items():
        if "properties" not in part:
            continue
        lines += [f".. _schema-{name}:", "", *heading(name, "-"), "", escaped(part.get("description", "")), ""]
        required = part.get("required", ())
        rows = [
            (
                f"``{key}``",
                _type(value),
                escaped(value.get("description", "")),
                "" if key in required else "may be left out",
            )
            for key, value in part["properties"].items()
        ]
        lines += [list_table(("field", "type", "meaning", ""), rows), ""]
    return "\n".join(lines)


def _type(part: Mapping[str, Any]) -> str:
    if "$ref" in part:
        name = part["$ref"].rpartition("/")[2]
        return f":ref:`{name} <schema-{name}>`" if name != "interval" else "interval: two numbers, or null"
    if "const" in part:
        return f"``{json.dumps(part['const'])}``"
    if "enum" in part:
        return ", ".join(f"``{json.dumps(value)}``" for value in part["enum"])
    if "anyOf" in part or "oneOf" in part:
        return " or ".join(_type(choice) for choice in part.get("anyOf") or part["oneOf"])
    kinds = part.get("type", "any")
    text = " or ".join([kinds] if isinstance(kinds, str) else kinds)
    if "items" in part and isinstance(part["items"], dict):
        return f"{text} of {_type(part['items'])}"
    return text
