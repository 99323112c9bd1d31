"""Where the requirement of a test is stated: what annotations, JUnit files and people want to see of a failure."""

from __future__ import annotations

import inspect
import os
import re
from pathlib import Path

import pytest

from pytest_drive_robust.verdict.requirement import Requirement


def requirements_of(item: pytest.Item) -> list[Requirement]:
    """Return the requirements that are parameters of a test."""
    callspec = getattr(item, "callspec", None)
    values = () if callspec is None else callspec.params.values()
    return [value for value in values if isinstance(value, Requirement)]


def place_of(item: pytest.Item, stated: object) -> tuple[str, int] | None:
    """Return the file, relative to the root folder, and the line, from 1, where a test has what it asks for.

    None where no sentence is found, or the test asks for something else than a requirement.
    """
    if not isinstance(stated, Requirement) or stated.written is None:
        return None
    path, line, sentence = stated.written
    if path is None:  # a text in the test's module
        path = item.path
        lines = path.read_text(encoding="utf-8", errors="replace").splitlines()
        whole = re.compile(rf"(?:(?<![\w.])|(?<=\\n)){re.escape(sentence)}(?![\w.])")  # the n of a line's end is none
        found = [number for number, text in enumerate(lines, 1) if whole.search(text)]
        if not found:
            return None
        own = _lines_of(item)  # another test may state the same, and closer to where this one begins
        line = min(found, key=lambda number: (number not in own, abs(number - own.start)))
    return Path(os.path.relpath(path, item.config.rootpath)).as_posix(), line


def _lines_of(item: pytest.Item) -> range:
    """Return the lines of the function of a test with its decorators, from 1; its first one where no more is known."""
    begin = (item.location[1] or 0) + 1
    try:
        count = len(inspect.getsourcelines(item.function)[0])  # type: ignore[attr-defined]
    except (AttributeError, OSError, TypeError):
        count = 1
    return range(begin, begin + count)
