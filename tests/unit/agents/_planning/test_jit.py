"""numba's cache looks at a kernel's own file only: no kernel of the planner may be taken from it when others change."""

from __future__ import annotations

import ast
import importlib
import inspect
from collections.abc import Iterator
from pathlib import Path
from types import FunctionType
from typing import Any

import numba
import pytest
from numba.core.caching import NullCache

from drive_robust_agents import _planning
from drive_robust_agents._planning.jit import sources_digest

PACKAGES = ("drive_robust_agents", "pytest_drive_robust")
MODULES = sorted(file.stem for file in Path(_planning.__file__).parent.glob("*.py") if file.stem != "__init__")
Dispatcher = type(numba.njit(lambda: None))


def cached_kernels(name: str) -> Iterator[Any]:
    module = importlib.import_module(f"{_planning.__name__}.{name}")
    for value in vars(module).values():
        ours = isinstance(value, Dispatcher) and value.__module__ == module.__name__
        if ours and is_cached(value):
            yield value


def is_cached(kernel: Any) -> bool:
    return not isinstance(kernel._cache, NullCache)


def imported_of_ours(function: FunctionType) -> set[str]:
    """The names in a file that come from other files of ours."""
    tree = ast.parse(Path(inspect.getsourcefile(function) or "").read_text())
    froms = [node for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)]
    ours = [
        node for node in froms if node.level or str(node.module).startswith(("drive_robust", "pytest_drive_robust"))
    ]
    return {alias.asname or alias.name for node in ours for alias in node.names}


def reached(function: FunctionType, seen: dict[str, Any]) -> dict[str, Any]:
    """Every global that a kernel uses, also by what it calls."""
    for name in set(function.__code__.co_names) & set(function.__globals__) - set(seen):
        seen[name] = function.__globals__[name]
        if isinstance(seen[name], Dispatcher):
            reached(seen[name].py_func, seen)
    return seen


def test_there_are_cached_kernels() -> None:
    assert {kernel.__name__ for name in MODULES for kernel in cached_kernels(name)} >= {"rollouts", "tracks", "project"}


@pytest.mark.parametrize("name", MODULES)
def test_a_cached_kernel_is_its_own_file_or_closes_over_every_source(name: str) -> None:
    for kernel in cached_kernels(name):
        function = kernel.py_func
        closed = [cell.cell_contents for cell in function.__closure__ or ()]
        used = reached(function, {})
        if sources_digest() not in closed:
            assert not imported_of_ours(function) & set(used), f"{name}.{kernel.__name__} closes over no digest"
            continue
        kept = [one.__name__ for one in used.values() if isinstance(one, Dispatcher) and is_cached(one)]
        assert kept == [], f"{name}.{kernel.__name__} calls kernels that are taken from the cache by themselves"
