"""Remember, while kernels are compiled, which of numba's implementations fits which types.

For every `+` and every index numba asks each of two dozen implementations whether it fits, twice, even if numba has
just asked for the same types. This takes a fifth of the time of compiling. The answer depends only on the function, the
types and the flags of the compiler, so this module keeps the answer; the machine code is the same.
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
"""By function, types and flags: the function (to keep it alive), its signature and numba's key of its code."""


@contextmanager
def remembered_resolutions() -> Iterator[None]:
    """Let numba reuse earlier answers within this context. May be nested; code outside the context is not affected."""
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
