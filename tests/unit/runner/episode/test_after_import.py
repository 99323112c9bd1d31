"""Something is done as soon as a module is loaded, and to nothing else."""

from __future__ import annotations

import importlib
import importlib.util
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from pytest_drive_robust.runner.episode.after_import import AfterImport

NAME = "module_that_comes_late"


@pytest.fixture
def told(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[list[int]]:
    """What was told: the number in the module at that time."""
    found: list[int] = []
    finder = AfterImport(NAME, lambda module: found.append(module.number))
    (tmp_path / f"{NAME}.py").write_text("number = 1")
    monkeypatch.syspath_prepend(tmp_path)
    finder.wait()
    yield found
    finder.forget()
    sys.modules.pop(NAME, None)


def test_a_module_is_told_of_once(told: list[int]) -> None:
    assert importlib.import_module(NAME).number == 1
    assert told == [1]
    importlib.import_module(NAME)
    assert told == [1]


def test_who_only_asks_whether_there_is_a_module_does_not_end_the_wait(told: list[int]) -> None:
    assert importlib.util.find_spec(NAME) is not None
    assert told == []
    importlib.import_module(NAME)
    assert told == [1]


def test_two_may_wait_for_the_same_module(told: list[int]) -> None:
    others: list[str] = []
    AfterImport(NAME, lambda module: others.append(module.__name__)).wait()
    importlib.import_module(NAME)
    assert (told, others) == ([1], [NAME])


def test_a_module_that_breaks_is_waited_for_again(told: list[int], tmp_path: Path) -> None:
    file = tmp_path / f"{NAME}.py"
    file.write_text("1 / 0")
    with pytest.raises(ZeroDivisionError):
        importlib.import_module(NAME)
    file.write_text("number = 22")
    importlib.invalidate_caches()
    importlib.import_module(NAME)
    assert told == [22]


def test_a_module_that_is_nowhere_is_missed_as_usual() -> None:
    finder = AfterImport("module_that_is_nowhere", print)
    finder.wait()
    try:
        with pytest.raises(ModuleNotFoundError):
            importlib.import_module("module_that_is_nowhere")
    finally:
        finder.forget()
    assert finder not in sys.meta_path
