"""Entry points with the functions that are compiled with them: which are missing, how many, which share some."""

from __future__ import annotations

from collections.abc import Sequence
from types import FunctionType, ModuleType
from typing import Any

from pytest_drive_robust.jit.kernels import Kernel
from pytest_drive_robust.jit.signatures import argument_types


def missing_entries(entries: Sequence[Any]) -> list[Any]:
    """Return the entry points that are neither loaded nor in the cache."""
    return [one for one in entries if not one.overloads and not one._cache.holds(_types(one), one.targetctx)]


def compile_entries(entries: Sequence[Any]) -> None:
    """Compile entry points for the types of their annotations, or load them from the cache."""
    for kernel in entries:
        kernel.compile(_types(kernel))


def _types(kernel: Any) -> tuple[Any, ...]:
    return argument_types(kernel.py_func)


def group_entries(entries: Sequence[Any]) -> list[list[Any]]:
    """Group entry points that share inner functions, so that each function is compiled once; largest group first."""
    groups: list[tuple[set[int], list[Any]]] = []
    for kernel in entries:
        reached, members = _reached(kernel), [kernel]
        for other in [one for one in groups if one[0] & reached]:
            groups.remove(other)
            reached, members = reached | other[0], other[1] + members
        groups.append((reached, members))
    return [members for _, members in sorted(groups, key=lambda one: -len(one[0]))]


def count_functions(entries: Sequence[Any]) -> int:
    """Return how many functions are compiled with these entry points, themselves included."""
    return len(set().union(*(_reached(kernel) for kernel in entries)))


def _reached(kernel: Any) -> set[int]:
    """Return the functions that are compiled with an entry point, by their identity."""
    seen: dict[int, Any] = {}
    _visit(kernel, seen)
    return set(seen)


def _visit(kernel: Any, seen: dict[int, Any]) -> None:
    if id(kernel) in seen:
        return
    seen[id(kernel)] = kernel
    function: FunctionType = kernel.py_func
    names = function.__code__.co_names
    for name in names:
        value = function.__globals__.get(name)
        found = [getattr(value, one, None) for one in names] if isinstance(value, ModuleType) else [value]
        for one in found:
            if isinstance(one, Kernel):
                _visit(one, seen)
