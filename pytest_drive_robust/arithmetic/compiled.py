"""Elementary functions of `scalars` for compiled code, bit for bit; `hypot` and `wrap_angle` for Python, too.

The functions take and return floats. The machine code of a function is made when a kernel that calls it is compiled, so
importing this module does not load numba.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, cast

from pytest_drive_robust.arithmetic import scalars, series

if TYPE_CHECKING:
    from pytest_drive_robust.arithmetic.scalars import atan, atan2, cos, cos_sin, exp, hypot, sin, tan
    from pytest_drive_robust.arithmetic.series import wrap_angle

__all__ = ["atan", "atan2", "cos", "cos_sin", "exp", "hypot", "sin", "tan", "wrap_angle"]

INLINED = ("hypot", "wrap_angle")
"""Short functions: their code becomes part of a kernel, and Python may call them, too."""


def python_function(name: str) -> Callable[..., Any]:
    """Return the function of `scalars` or `series` that `name` is the compiled version of."""
    return cast("Callable[..., Any]", getattr(scalars, name, None) or getattr(series, name))


class CompiledFunction:
    """Stand-in for one function of this module in a kernel; numba reads its `_numba_type_`."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.py_func = python_function(name)

    @functools.cached_property
    def _numba_type_(self) -> Any:
        from pytest_drive_robust.arithmetic.symbols import numba_type  # loads numba

        return numba_type(self.name)

    def load(self) -> None:
        """Compile or load the machine code; a kernel that is loaded from the cache calls this code by its symbol."""
        from pytest_drive_robust.arithmetic import symbols  # loads numba

        symbols.load(self.name)

    def __call__(self, *numbers: float) -> float:
        if self.name not in INLINED:
            raise TypeError(f"only compiled code can call this function; arithmetic.scalars.{self.name} is for Python")
        return float(self.py_func(*numbers))


def __getattr__(name: str) -> CompiledFunction:
    """Return the `CompiledFunction` of this name. Raises `AttributeError` for a name that is not in `__all__`."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    function = globals()[name] = CompiledFunction(name)
    return function
