"""Says whether a test that an error stopped had anything left to do, and so may have asked `drive` for more."""

from __future__ import annotations

import ast
import linecache
from collections.abc import Iterator, Sequence
from pathlib import Path
from types import TracebackType

import pytest

_OURS = "pytest_drive_robust."
_GOES_ON = ("test", "subTest")
"""The methods of `subtests` and of `unittest.TestCase` whose `with` block keeps an error to itself."""
_LOOPS = (ast.For, ast.AsyncFor, ast.While)
_MAY_SKIP = (ast.BoolOp, ast.IfExp, ast.ListComp, ast.SetComp, ast.DictComp, ast.GeneratorExp)
"""Parts of a statement after which it may not have evaluated everything: `assert first() and second()`."""
_FUNCTIONS = (ast.FunctionDef, ast.AsyncFunctionDef)


def has_statements_left(item: pytest.Item, traceback: TracebackType | None, *, in_subtest: bool) -> bool:
    """Return whether statements may have been left when the error with `traceback` stopped the test.

    Looks at the first function of the test's file, or of a conftest.py, and at those that it called, down to ours. An
    error in a subtest leaves the rest of its `with` block. Returns True when the code cannot be read.
    """
    places = list(_places(item.path, traceback))
    return not places or any(_left_after(*place, in_subtest=in_subtest) for place in places)


def _places(file: Path, traceback: TracebackType | None) -> Iterator[tuple[str, int]]:
    """Yield (file, line) of each call from the first one in `file` or in a conftest.py down to the first of ours."""
    inside = False
    while traceback is not None:
        code = traceback.tb_frame.f_code
        if inside and str(traceback.tb_frame.f_globals.get("__name__", "")).startswith(_OURS):
            return
        inside = inside or code.co_filename == str(file) or Path(code.co_filename).name == "conftest.py"
        if inside:
            yield code.co_filename, traceback.tb_lineno
        traceback = traceback.tb_next


def _left_after(file: str, line: int, *, in_subtest: bool) -> bool:
    """Return whether the function of `line` goes on after the statement of that line."""
    try:
        body: Sequence[ast.stmt] = ast.parse("".join(linecache.getlines(file))).body
    except (SyntaxError, ValueError):
        return True
    left, found = False, None
    while (found := _at(body, line)) is not None:
        statement, later = found
        left = left or later or isinstance(statement, _LOOPS)
        if isinstance(statement, (*_FUNCTIONS, ast.ClassDef)) or (in_subtest and _keeps_errors(statement)):
            left = False  # what surrounds a function is not part of it, and what surrounds a subtest goes on
        blocks = list(_blocks(statement))
        around = [block for block in blocks if _at(block, line) is not None]
        if not around:  # the line of a simple statement, or the head of a compound one
            return left or any(blocks) or any(isinstance(part, _MAY_SKIP) for part in ast.walk(statement))
        body = around[0]
    return True  # the file is another one than was imported


def _at(body: Sequence[ast.stmt], line: int) -> tuple[ast.stmt, bool] | None:
    """Return the statement of `body` at a line, and whether another one follows it; None without one."""
    for place, statement in enumerate(body):
        if statement.lineno <= line <= (statement.end_lineno or statement.lineno):
            return statement, place + 1 < len(body)
    return None


def _blocks(statement: ast.stmt) -> Iterator[Sequence[ast.stmt]]:
    """Yield every block of a compound statement."""
    for name in ("body", "orelse", "finalbody"):
        yield getattr(statement, name, [])
    for name in ("handlers", "cases"):
        for part in getattr(statement, name, []):
            yield part.body


def _keeps_errors(statement: ast.stmt) -> bool:
    """Return True for `with subtests.test(...):` and `with self.subTest(...):`."""
    if not isinstance(statement, ast.With):
        return False
    calls = (item.context_expr for item in statement.items)
    return any(
        isinstance(call, ast.Call) and isinstance(call.func, ast.Attribute) and call.func.attr in _GOES_ON
        for call in calls
    )
