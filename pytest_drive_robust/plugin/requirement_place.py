"""Finds the file and line where a test states its requirement, for annotations, JUnit files and failure messages."""

from __future__ import annotations

import inspect
import os
import re
from pathlib import Path

import pytest

from pytest_drive_robust.verdict.requirement import Requirement


def requirements_of(item: pytest.Item) -> dict[str, Requirement]:
    """Return the requirements that are parameters of a test, or stand in one that is a list, tuple or dictionary.

    Their keys are how the test names them: `"wanted"`, `"wanted[0]"`, `"case['wanted']"`.
    """
    named = dict(getattr(getattr(item, "callspec", None), "params", {}))
    for name, value in list(named.items()):
        parts = dict(enumerate(value)) if isinstance(value, (list, tuple)) else value
        if isinstance(parts, dict):
            named |= {f"{name}[{key!r}]": each for key, each in parts.items()}
    return {name: value for name, value in named.items() if isinstance(value, Requirement)}


def place_of(item: pytest.Item, stated: object) -> tuple[str, int] | None:
    """Return the file, relative to the root folder, and the line, from 1, where a test states its requirement.

    Returns None when the sentence is not found, or when `stated` is no requirement.
    """
    if not isinstance(stated, Requirement) or stated.written is None:
        return None
    path, line, sentence = stated.written
    if path is None:  # the requirement was written in the test's module
        path = item.path
        lines = path.read_text(encoding="utf-8", errors="replace").splitlines()
        whole = re.compile(rf"(?:(?<![\w.])|(?<=\\n)){re.escape(sentence)}(?![\w.])")  # the n of "\n" is no letter
        found = [number for number, text in enumerate(lines, 1) if whole.search(text)]
        if not found:
            return None
        own = _lines_of(item)  # another test may state the same sentence nearer to this test's first line
        line = min(found, key=lambda number: (number not in own, abs(number - own.start)))
    return Path(os.path.relpath(path, item.config.rootpath)).as_posix(), line


def _lines_of(item: pytest.Item) -> range:
    """Return the line numbers, from 1, of a test function with its decorators; only its first without source."""
    begin = (item.location[1] or 0) + 1
    try:
        count = len(inspect.getsourcelines(item.function)[0])  # type: ignore[attr-defined]
    except (AttributeError, OSError, TypeError):
        count = 1
    return range(begin, begin + count)
