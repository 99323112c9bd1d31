"""Whether an error that stopped a test left statements: read from the test's code, by the line of each call."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace, TracebackType
from typing import Any

import pytest

from pytest_drive_robust.plugin.statements_left import has_statements_left

LAST = """
def test():
    fine()
    fail()
"""
IN_THE_MIDDLE = """
def test():
    fail()
    fine()
"""
OVER_LINES = """
def test():
    assert fail(
        1
    )
"""
IN_A_LOOP = """
def test():
    for _ in range(1):
        fail()
"""
IN_A_BRANCH = """
def test():
    if True:
        fail()
    else:
        fine()
"""
BEFORE_A_BRANCH = """
def test():
    if fail():
        fine()
"""
IN_A_TRY = """
def test():
    try:
        fail()
    finally:
        fine()
"""
IN_A_HELPER = """
def test():
    both()

def both():
    fail()
    fine()
"""
AT_A_HELPERS_END = """
def both():
    fine()
    fail()

def test():
    both()
"""
IN_A_COMPREHENSION = """
def test():
    assert all(fail() for _ in range(2))
"""
SHORT_CUT = """
def test():
    assert fail() and fine()
"""
IN_A_CLASS = """
class TestIt:
    def method(self):
        fail()

    def other(self):
        fine()

test = TestIt().method
"""
IN_A_SUBTEST = """
def test(subtests=Subtests()):
    for _ in range(2):
        with subtests.test("this"):
            fail()
    fine()
"""
IN_THE_MIDDLE_OF_A_SUBTEST = """
def test(subtests=Subtests()):
    with subtests.test("this"):
        fail()
        fine()
"""


class Subtests:
    """Lets errors through, so that a test can look at them."""

    def test(self, name: str) -> Subtests:
        return self

    def __enter__(self) -> None: ...

    def __exit__(self, *_: object) -> None: ...


def ours() -> dict[str, Any]:
    """Return names as a test sees them; `fail` is one of ours, as `drive.check` is."""
    names: dict[str, Any] = {"__name__": "pytest_drive_robust.made_up"}
    exec("def fail(*_): 1 / 0", names)
    return {"fail": names["fail"], "fine": lambda: None, "Subtests": Subtests, "__name__": "test_it"}


def error_of(text: str, path: Path) -> TracebackType | None:
    path.write_text(text, encoding="utf-8")
    names = ours()
    exec(compile(text, str(path), "exec"), names)
    with pytest.raises(ZeroDivisionError) as raised:
        names["test"]()
    return raised.tb


@pytest.mark.parametrize(
    ("text", "left"),
    [
        (LAST, False),
        (IN_THE_MIDDLE, True),
        (OVER_LINES, False),
        (IN_A_LOOP, True),
        (IN_A_BRANCH, False),
        (BEFORE_A_BRANCH, True),
        (IN_A_TRY, False),
        (IN_A_HELPER, True),
        (AT_A_HELPERS_END, False),
        (IN_A_COMPREHENSION, True),
        (SHORT_CUT, True),
        (IN_A_CLASS, False),
        (IN_A_SUBTEST, False),
        (IN_THE_MIDDLE_OF_A_SUBTEST, True),
    ],
    ids=lambda value: " ".join(value.split()) if isinstance(value, str) else "",
)
def test_what_is_left_is_what_the_code_says(text: str, left: bool, tmp_path: Path) -> None:
    path = tmp_path / "test_it.py"
    item: Any = SimpleNamespace(path=path)
    assert has_statements_left(item, error_of(text, path), in_subtest="subtests" in text) == left


def test_code_that_cannot_be_read_may_have_more(tmp_path: Path) -> None:
    path = tmp_path / "test_it.py"
    traceback = error_of(LAST, path)
    item: Any = SimpleNamespace(path=path)
    path.write_text("nothing of this is Python")
    assert has_statements_left(item, traceback, in_subtest=False)
    item.path = tmp_path / "test_other.py"
    assert has_statements_left(item, traceback, in_subtest=False)
