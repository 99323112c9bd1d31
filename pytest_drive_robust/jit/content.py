"""A digest of everything in the sources that decides the machine code of a function."""

from __future__ import annotations

import enum
import hashlib
import sys
from collections.abc import Callable
from types import CodeType, FunctionType, ModuleType
from typing import Any

import llvmlite
import numba
import numpy as np
from numba.core.dispatcher import Dispatcher

from pytest_drive_robust.jit.kernels import Kernel

_LIBRARIES = ("math", "numpy", "numba")
"""Modules whose content is not read: their versions are in the digest."""


def content_digest(function: Callable[..., Any]) -> str:
    """Return a digest of a function's code, of all functions that it calls and of every constant in them.

    Raises `TypeError` for a constant that has no content to compare.
    """
    digest = hashlib.blake2b(digest_size=12)
    for part in (numba.__version__, llvmlite.__version__, np.__version__, sys.version_info[:2]):
        digest.update(repr(part).encode())
    _add_function(getattr(function, "py_func", function), digest, set())
    return digest.hexdigest()


def _add_function(function: Any, digest: Any, seen: set[int]) -> None:
    if id(function) in seen:
        return
    seen.add(id(function))
    code = function.__code__
    digest.update(function.__name__.encode())
    for value in (code, *(function.__defaults__ or ()), *(function.__kwdefaults__ or {}).values()):
        _add_value(value, code.co_names, digest, seen)
    for cell in function.__closure__ or ():
        _add_value(cell.cell_contents, code.co_names, digest, seen)
    for name in code.co_names:
        if name in function.__globals__:
            digest.update(name.encode())
            _add_value(function.__globals__[name], code.co_names, digest, seen)


def _add_value(value: Any, names: tuple[str, ...], digest: Any, seen: set[int]) -> None:
    """Add a value that a function contains or finds in its globals to `digest`.

    `names` are the names that the function uses, attributes of modules included. Raises `TypeError` for a value whose
    content cannot be compared: a change of this value would go unseen, and outdated code would be used.
    """
    if isinstance(value, Kernel):
        value = value.dispatcher
    if isinstance(value, Dispatcher):
        digest.update(repr(sorted(value.targetoptions.items(), key=str)).encode())
        value = value.py_func
    elif isinstance(getattr(value, "py_func", None), FunctionType):  # of `arithmetic.compiled`
        value.load()
        value = value.py_func
    if isinstance(value, FunctionType):
        _add_function(value, digest, seen)
    elif isinstance(value, ModuleType):
        digest.update(value.__name__.encode())
        for name in names:
            if hasattr(value, name) and value.__name__.split(".")[0] not in _LIBRARIES:
                _add_value(getattr(value, name), names, digest, seen)
    elif isinstance(value, np.ndarray):
        digest.update(repr((value.dtype.str, value.shape)).encode() + value.tobytes())
    elif isinstance(value, (bool, int, float, complex, str, bytes, enum.Enum, np.generic, type(None))):
        digest.update(f"{type(value).__name__}{value!r}".encode())
    elif isinstance(value, CodeType):  # also that of a comprehension, which is a constant of the function around it
        digest.update(repr((value.co_names, value.co_varnames, value.co_freevars)).encode() + value.co_code)
        for constant in value.co_consts:
            _add_value(constant, names, digest, seen)
    elif isinstance(value, (tuple, list, frozenset)):
        for item in sorted(value, key=repr) if isinstance(value, frozenset) else value:
            _add_value(item, names, digest, seen)
    elif hasattr(value, "__qualname__"):  # a class, an intrinsic
        digest.update(repr((value.__module__, value.__qualname__, getattr(value, "_fields", ()))).encode())
    else:
        raise TypeError(f"a kernel uses {value!r}, and a {type(value).__name__} has no content that could be compared")
