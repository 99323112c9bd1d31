"""Import our own modules without what pytest and the garbage collector would do meanwhile."""

from __future__ import annotations

import gc
import sys
from collections.abc import Iterator
from contextlib import contextmanager

from _pytest.assertion.rewrite import AssertionRewritingHook


@contextmanager
def quick_import() -> Iterator[None]:
    """Import modules without rewriting their asserts, which are no tests, and without looking for garbage.

    pytest rewrites the asserts of every module of an installed plugin: that takes longer than all other imports in the
    first session after the installation, and a tenth of them later.
    """
    finders, collects = list(sys.meta_path), gc.isenabled()
    sys.meta_path[:] = [finder for finder in finders if not isinstance(finder, AssertionRewritingHook)]
    gc.disable()
    try:
        yield
    finally:
        new = [finder for finder in sys.meta_path if finder not in finders]
        sys.meta_path[:] = [*new, *finders]
        if collects:
            gc.enable()
