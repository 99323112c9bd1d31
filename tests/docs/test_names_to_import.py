"""Who writes a world begins with a copy of the fake one: all that it imports is on the page of what may be imported."""

from __future__ import annotations

import ast
import inspect
from pathlib import Path

import pytest_drive_robust
from pytest_drive_robust.testing import fake_simulator

PAGE = Path(__file__).parents[2] / "docs" / "reference" / "api.rst"


def test_the_page_of_names_holds_all_that_a_copy_of_the_fake_world_imports() -> None:
    listed = {line.rpartition(" ")[2] for line in PAGE.read_text(encoding="utf-8").splitlines() if "::" in line}
    imports = [
        node for node in ast.walk(ast.parse(inspect.getsource(fake_simulator))) if isinstance(node, ast.ImportFrom)
    ]
    ours = [node for node in imports if (node.module or "").startswith("pytest_drive_robust")]
    named = {(node.module, alias.name) for node in ours for alias in node.names}
    missing = {
        f"{module}.{name}"
        for module, name in named
        if not {module, f"{module}.{name}"} & listed and name not in pytest_drive_robust.__all__
    }
    assert named
    assert missing == set()
