"""Imports our own modules quickly, without assertion rewriting and garbage collection."""

from __future__ import annotations

import gc
import sys
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def quick_import() -> Iterator[None]:
    """Switch off assertion rewriting and garbage collection for the imports in the body.

    pytest rewrites the asserts of every module of an installed plugin, although ours are no tests. In the first session
    after the installation the rewriting takes longer than all other imports, and a tenth of their time later.
    """
    finders, collects = list(sys.meta_path), gc.isenabled()
    sys.meta_path[:] = [finder for finder in finders if not _is_of_pytest(finder)]
    gc.disable()
    try:
        yield
    finally:
        new = [finder for finder in sys.meta_path if finder not in finders]
        sys.meta_path[:] = [*new, *finders]
        if collects:
            gc.enable()


def _is_of_pytest(finder: object) -> bool:
    """Return True for the finder of pytest, which rewrites asserts; its class is private."""
    return type(finder).__module__.partition(".")[0] == "_pytest"
