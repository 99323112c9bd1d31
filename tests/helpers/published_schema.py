"""The schema of `--drive-json` as it is published with the package."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest_drive_robust


def run_schema() -> dict[str, Any]:
    path = Path(pytest_drive_robust.__file__).parent / "report" / "schema" / "run.schema.json"
    schema: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return schema
