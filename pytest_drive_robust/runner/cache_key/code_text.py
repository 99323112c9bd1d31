"""Turns code into one text for digests: a factory, a class or a configured object, with the values it was made with."""

from __future__ import annotations

import functools
import inspect
import os
import secrets
import struct
import sys
from collections.abc import Iterator
from types import FunctionType, MemberDescriptorType, MethodType, ModuleType
from typing import Any

from pytest_drive_robust.perturbations.base import Setting
from pytest_drive_robust.runner.cache_key.canonical_text import canonical_text, is_ours_or_standard, plain
from pytest_drive_robust.runner.cache_key.distributions import is_installed, versions_of
from pytest_drive_robust.runner.cache_key.named_files import file_digests
from pytest_drive_robust.runner.cache_key.source_files import (
    UnknownSourceError,
    file_of,
    file_of_code,
    module_digest,
)

_OWN = __name__.partition(".")[0]
SESSION = os.environ.get("PYTEST_XDIST_TESTRUNUID") or secrets.token_hex(8)
"""Names this process; under pytest-xdist all workers of a run share it, and on a cluster's node it names the run."""
_RUN = [""]


def begin_run(name: str) -> None:
    """Begin a run: keys of unknown code now differ from those of earlier runs in this process, as in a notebook.

    `name` is the same in all processes of this run, and no other run has it.
    """
    _RUN[0] = name


def session() -> str:
    """Return the text that stands for unknown code: no other run has this text, so no stored episode is reused."""
    return SESSION + _RUN[0]


def perturbation_sources(setting: Setting) -> tuple[str, ...]:
    """Return the code and the `files` of a setting's perturbation classes that are not ours, in the setting's order.

    The identity covers our own classes. Raises `UsageError` for a file that cannot be read.
    """
    classes: Iterator[Any] = map(type, setting.perturbations)
    others = [cls for cls in classes if cls.__module__.partition(".")[0] != _OWN]
    return tuple(text for cls in others for text in (_class_code(cls, session()), *file_digests(cls)))


def code_of(target: object, *, libraries: bool = True) -> str:
    """Return a text that is equal for equal code with equal parameters.

    The text covers the source (see `source_files`), the arguments of a `functools.partial`, the default values and the
    closure of a function, the state of a callable object, and the classes of all these values. When one of them has no
    comparable content, the text holds for this session only. With `libraries` the versions of Python and of installed
    libraries count, too.
    """
    try:
        return canonical_text(_Description(libraries=libraries)(target))
    except (UnknownSourceError, TypeError, RecursionError) as error:
        return f"session {session()} {type(target).__qualname__} {error}"


@functools.cache
def _class_code(cls: type, _session: str) -> str:
    """Return the code of a class, cached: a plan asks for the same few classes thousands of times."""
    return code_of(cls)


class _Description:
    """Describes objects by their code and by the values that they hold; an object inside itself is `"itself"`."""

    def __init__(self, *, libraries: bool) -> None:
        self._libraries = libraries
        self._around: list[int] = []

    def __call__(self, target: Any) -> object:
        """Return the description of `target` as JSON types."""
        if id(target) in self._around:
            return "itself"
        self._around.append(id(target))
        found = plain(self._parts(target), otherwise=self)
        self._around.pop()
        return found

    def _parts(self, target: Any) -> object:
        if isinstance(target, functools.partial):
            return ["partial", self(target.func), target.args, target.keywords]
        if isinstance(target, MethodType):
            return ["method", self(target.__func__), target.__self__]
        if isinstance(target, FunctionType) and _wraps_on_its_own(target):
            source = module_digest(file_of_code(target), _module_of_code(target), libraries=self._libraries)
            return ["wrapper", self(vars(target)["__wrapped__"]), source, _bindings(target)]
        target = inspect.unwrap(target) if callable(target) else target
        if isinstance(target, type):
            return ["class", target.__qualname__, self._source(target), _made_at_run_time(target), *self._bases(target)]
        if isinstance(target, FunctionType):
            return ["function", target.__qualname__, self._source(target), _bindings(target)]
        if isinstance(target, ModuleType):
            return ["module", self._source(target)]
        configuration = getattr(target, "configuration", None)
        state = _state(target) if configuration is None else configuration
        return ["object", self(type(target)), state]

    def _source(self, target: Any) -> str:
        module = target.__name__ if isinstance(target, ModuleType) else str(getattr(target, "__module__", ""))
        return module_digest(file_of(target), module, libraries=self._libraries)

    def _bases(self, cls: type) -> Iterator[object]:
        """Yield the bases of a class inside a function: they may be the function's arguments, which no import shows."""
        for base in cls.__bases__ if "<locals>" in cls.__qualname__ else ():
            if is_ours_or_standard(base):
                continue
            if not is_installed(file_of(base)):
                yield self(base)
            elif self._libraries:
                yield versions_of([base.__module__])


def _state(target: Any) -> dict[str, Any]:
    """Return the values in an object's `__dict__` and slots, by name.

    Raises `TypeError` for an object that may keep more data out of sight, such as a tensor of torch.
    """
    cls, pointer_bytes = type(target), struct.calcsize("P")
    slots = {
        name: member
        for base in cls.__mro__
        for name, member in vars(base).items()
        if isinstance(member, MemberDescriptorType)
    }
    places = len(slots) + (cls.__dictoffset__ > 0) + (cls.__weakrefoffset__ > 0)
    if cls.__itemsize__ or cls.__basicsize__ > object.__basicsize__ + pointer_bytes * places:
        raise TypeError(f"{cls.__name__} keeps what cannot be compared")
    filled = {name: getattr(target, name) for name in slots if hasattr(target, name)}
    return {**filled, **vars(target)}


def _wraps_on_its_own(function: FunctionType) -> bool:
    """Return whether a wrapper's own code counts; an installed library's wrapper does not, as its version counts."""
    if not hasattr(function, "__wrapped__"):
        return False
    top = _module_of_code(function).partition(".")[0]
    inner = str(getattr(inspect.unwrap(function), "__module__", "")).partition(".")[0]
    if top == inner:
        return True
    return top != _OWN and top not in sys.stdlib_module_names and not is_installed(file_of_code(function))


def _module_of_code(function: FunctionType) -> str:
    """Return the module that a function was written in: a wrapper's `__module__` is that of the wrapped function."""
    return str(function.__globals__.get("__name__", ""))


def _bindings(function: FunctionType) -> object:
    """Return the values that a function carries besides its source: defaults and closure variables."""
    cells = zip(function.__code__.co_freevars, function.__closure__ or (), strict=True)
    return [function.__defaults__, function.__kwdefaults__, [[name, _content(cell)] for name, cell in cells]]


def _content(cell: Any) -> object:
    try:
        return cell.cell_contents
    except ValueError:  # the cell is still empty
        return None


def _made_at_run_time(cls: type) -> object:
    """Return the values that a class inside a function took from that function; empty for other classes."""
    if "<locals>" not in cls.__qualname__:
        return []
    found = []
    for name, value in sorted(vars(cls).items()):
        if isinstance(value, FunctionType):
            found.append([name, _bindings(value)])
        elif isinstance(value, property):
            accessors = (value.fget, value.fset, value.fdel)
            bound = [_bindings(one) if isinstance(one, FunctionType) else one for one in accessors]
            found += [[name, bound]] if any(one not in (None, [None, None, []]) for one in bound) else []
        elif not name.startswith("__") and not inspect.isdatadescriptor(value):
            found.append([name, value])
    return found
