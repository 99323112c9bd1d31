"""What a factory, a class or a configured object is, as values for a digest: its code and what it was made with."""

from __future__ import annotations

import functools
import inspect
import os
import secrets
from types import FunctionType, MethodType, ModuleType
from typing import TYPE_CHECKING, Any, NamedTuple

from pytest_drive_robust.runner.cache_key.canonical_text import canonical_text
from pytest_drive_robust.runner.cache_key.source_files import UnknownSourceError, file_of, module_digest

if TYPE_CHECKING:
    from pytest_drive_robust.perturbations.base import Setting

__all__ = ["SESSION", "code_of", "perturbation_sources"]

SESSION = os.environ.get("PYTEST_XDIST_TESTRUNUID") or secrets.token_hex(8)
"""Stands for code that cannot be known: no other run has it, so nothing is taken for the same. Workers share it."""

_OWN = __name__.partition(".")[0]


def perturbation_sources(setting: Setting) -> tuple[str, ...]:
    """Return the code of a setting's classes that are not ours, in its order. Ours are a part of the identity."""
    classes = (type(perturbation) for perturbation in setting.perturbations)
    return tuple(_class_code(cls) for cls in classes if cls.__module__.partition(".")[0] != _OWN)


_CODES: dict[type, str] = {}
"""Of classes that were looked at: a plan asks for the same few thousands of times."""


def _class_code(cls: type) -> str:
    if cls not in _CODES:
        _CODES[cls] = code_of(cls)
    return _CODES[cls]


def code_of(target: object, *, libraries: bool = True) -> str:
    """Return a text that is equal for equal code with equal parameters.

    That is the source (see `source_files`), and the arguments of a `functools.partial`, the default values and the
    closure of a function, the state of an object that is called. Where one of them has no comparable content, the text
    is of this session only. `libraries`: the versions of Python and of installed libraries count, too.
    """
    try:
        return canonical_text(_describe(target, _Within((), libraries)))
    except (UnknownSourceError, TypeError) as error:
        return f"session {SESSION} {type(target).__qualname__} {error}"


class _Within(NamedTuple):
    """The objects around the one that is described, and whether libraries count."""

    objects: tuple[int, ...]
    libraries: bool


def _describe(target: Any, within: _Within) -> object:
    if id(target) in within.objects:
        return "itself"
    within = _Within((*within.objects, id(target)), within.libraries)
    if isinstance(target, functools.partial):
        return ["partial", _describe(target.func, within), _value(target.args, within), _value(target.keywords, within)]
    if isinstance(target, MethodType):
        return ["method", _describe(target.__func__, within), _value(target.__self__, within)]
    target = inspect.unwrap(target) if callable(target) else target
    if isinstance(target, type):
        return ["class", target.__qualname__, _source(target, within), _made_at_run_time(target, within)]
    if isinstance(target, FunctionType):
        return ["function", target.__qualname__, _source(target, within), _bindings(target, within)]
    if isinstance(target, ModuleType):
        return ["module", _source(target, within)]
    configuration = getattr(target, "configuration", None)
    state = vars(target) if configuration is None else configuration
    return ["object", _describe(type(target), within), _value(state, within)]


def _value(value: Any, within: _Within) -> object:
    """Return plain values as they are; code within them as code."""
    if isinstance(value, dict):
        return [[name, _value(item, within)] for name, item in value.items()]
    if isinstance(value, (list, tuple)):
        return [_value(item, within) for item in value]
    try:
        canonical_text(value)
    except TypeError:
        return _describe(value, within)
    return value


def _bindings(function: FunctionType, within: _Within) -> object:
    """Return what a function carries besides its text: defaults and the variables of functions around it."""
    cells = zip(function.__code__.co_freevars, function.__closure__ or (), strict=True)
    defaults = (function.__defaults__ or (), function.__kwdefaults__ or {})
    return [_value(defaults, within), [[name, _value(_content(cell), within)] for name, cell in cells]]


def _content(cell: Any) -> object:
    try:
        return cell.cell_contents
    except ValueError:  # not filled yet
        return None


def _made_at_run_time(cls: type, within: _Within) -> object:
    """Return for a class inside a function what its methods and attributes took from there."""
    if "<locals>" not in cls.__qualname__:
        return []
    found = []
    for name, value in sorted(vars(cls).items()):
        if isinstance(value, FunctionType):
            found.append([name, _bindings(value, within)])
        elif not name.startswith("__") and not inspect.isdatadescriptor(value):
            found.append([name, _value(value, within)])
    return found


def _source(target: Any, within: _Within) -> str:
    module = target.__name__ if isinstance(target, ModuleType) else str(getattr(target, "__module__", ""))
    return module_digest(file_of(target), module, libraries=within.libraries)
