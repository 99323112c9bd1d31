"""Limits computing libraries to one thread while episodes are driven in the process of the run.

Sums over several threads differ in the last bits. Worker processes have one thread, and an episode driven here must be
the same.
"""

from __future__ import annotations

import sys
from contextlib import ExitStack
from types import TracebackType

_LIBRARIES = (("torch", "get_num_threads", "set_num_threads"), ("cv2", "getNumThreads", "setNumThreads"))


class OneThread:
    """Limits libraries to one thread inside a `with` block, and restores their threads at its end."""

    def __init__(self) -> None:
        self._stack = ExitStack()

    def __enter__(self) -> OneThread:
        self.limit()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self._stack.close()

    def limit(self) -> None:
        """Limit the libraries loaded by now; call again after an agent loaded more."""
        from threadpoolctl import threadpool_limits  # late: a run from the store does not need it

        # Searched each time, in 2 ms: between episodes a test has its threads back and may load libraries.
        self._stack.enter_context(threadpool_limits(limits=1))
        for name, getter, setter in _LIBRARIES:
            library = sys.modules.get(name)
            threads = 1 if library is None else getattr(library, getter)()
            if threads != 1:
                getattr(library, setter)(1)
                self._stack.callback(getattr(library, setter), threads)
