"""The examples in docstrings are what the code does."""

from __future__ import annotations

import doctest
import importlib
import io
import pkgutil
from collections.abc import Iterator
from types import ModuleType

import drive_robust_agents
import pytest_drive_robust

_LEFT_OUT = ("__main__", "stand_ins", "drive_robust_agents.training", "drive_robust_agents._nets", "engine.ray")
"""Programs, modules for another Python's path, and what needs torch or Ray: they have no examples."""


def modules() -> Iterator[ModuleType]:
    for package in (pytest_drive_robust, drive_robust_agents):
        for found in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
            if not any(part in found.name for part in _LEFT_OUT):
                yield importlib.import_module(found.name)


def test_every_example_in_a_docstring_is_true() -> None:
    told, runner = io.StringIO(), doctest.DocTestRunner(verbose=False)
    finder = doctest.DocTestFinder(exclude_empty=True)
    for module in modules():
        for example in finder.find(module, module.__name__):
            runner.run(example, out=told.write)
    assert runner.summarize(verbose=False).failed == 0, told.getvalue()
    assert runner.tries > 30
