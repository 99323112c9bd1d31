"""The argument types of an entry point from its annotations: an entry point is compiled for these types only."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any, get_args, get_origin, get_type_hints

import numba
import numpy as np

types: Any = numba.types

_SCALARS: dict[object, Any] = {float: types.float64, int: types.int64, bool: types.boolean}


def argument_types(function: Callable[..., Any]) -> tuple[Any, ...]:
    """Return numba's types of the arguments of an annotated function.

    Arrays are annotated with their dimensions, `Annotated[NDArray[np.uint8], 3]`, and are writable and contiguous.
    Raises `TypeError` for an annotation that no kernel can take.
    """
    hints = get_type_hints(function, include_extras=True)
    hints.pop("return", None)
    return tuple(numba_type(hint) for hint in hints.values())


def numba_type(hint: Any) -> Any:
    """Return numba's type for an annotation: a number, an array, a tuple, a NamedTuple or a class with `numba_type`."""
    if hint in _SCALARS:
        return _SCALARS[hint]
    if hasattr(hint, "numba_type"):
        return hint.numba_type()
    if get_origin(hint) is Annotated:
        array, dimensions = get_args(hint)
        parts = get_args(array)  # shape and dtype; the scalar alone where NDArray is an alias (numpy 2.5)
        scalar = parts[0] if len(parts) == 1 else get_args(parts[1])[0]
        return types.Array(numba.from_dtype(np.dtype(scalar)), dimensions, "C")
    if get_origin(hint) is tuple:
        return types.BaseTuple.from_types([numba_type(part) for part in get_args(hint)])
    if isinstance(hint, type) and issubclass(hint, tuple):
        fields = get_type_hints(hint, include_extras=True)
        return types.BaseTuple.from_types([numba_type(part) for part in fields.values()], hint)
    raise TypeError(f"a kernel takes numbers, tuples and arrays annotated with their dimensions, not {hint!r}")
