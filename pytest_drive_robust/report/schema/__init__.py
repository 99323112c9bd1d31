"""The published schema of `--drive-json`: JSON Schema, draft 2020-12, in `run.schema.json` beside this file."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

__all__ = ["RUN_SCHEMA", "run_schema"]

RUN_SCHEMA = Path(__file__).with_name("run.schema.json")
"""The file itself, for validators in other languages."""


def run_schema() -> dict[str, Any]:
    """Return the schema of the document that `--drive-json` writes."""
    schema: dict[str, Any] = json.loads(RUN_SCHEMA.read_text(encoding="utf-8"))
    return schema
