"""Remember, while kernels are compiled, which of numba's implementations fits which types.

For every `+` and every index numba asks each implementation that it knows whether it fits, two dozen of them, twice,
although it has just done so for the same types: a fifth of all that compiling takes. The answer depends on nothing but
the function, the types and the flags of the compiler, so it is kept; the machine code is the same.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from numba.core import targetconfig
from numba.core.types.functions import BaseFunction

_BASE: Any = BaseFunction
_RESOLVE: Any = BaseFunction.get_call_type
_KNOWN: dict[Any, tuple[Any, Any, Any]] = {}
"""By function, types and flags: the function (which stays alive so), the signature and what numba finds its code by."""


@contextmanager
def remembered_resolutions() -> Iterator[None]:
    """Let numba look up what it has found out before. May be nested; other code that uses numba meets none of it."""
    before = _BASE.get_call_type
    _BASE.get_call_type = _resolved
    try:
        yield
    finally:
        _BASE.get_call_type = before


def _resolved(function: Any, context: Any, arguments: Any, keywords: Any) -> Any:
    """Return the signature of a call, as `BaseFunction.get_call_type` does."""
    flags = targetconfig.ConfigStack.top_or_none()
    options = "" if flags is None else flags.summary()
    key = id(function), id(context), tuple(arguments), tuple(keywords.items()), options
    if key in _KNOWN:
        _, signature, implementation = _KNOWN[key]
        function._impl_keys[signature.args] = implementation
        return signature
    signature = _RESOLVE(function, context, arguments, keywords)
    if signature is not None:
        _KNOWN[key] = function, signature, function._impl_keys[signature.args]
    return signature
