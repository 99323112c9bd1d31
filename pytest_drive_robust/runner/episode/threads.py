"""One thread for the libraries that compute, where episodes are driven in the process of the run.

Sums over several threads differ in the last bits, and worker processes have one: what is driven here must be the same.
"""

from __future__ import annotations

import sys
from contextlib import ExitStack
from types import TracebackType

_LIBRARIES = (("torch", "get_num_threads", "set_num_threads"), ("cv2", "getNumThreads", "setNumThreads"))


class OneThread:
    """Limits libraries while it is entered, and gives them back the threads that they had."""

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
        """Limit also what was loaded since, as by the agent that was made."""
        from threadpoolctl import threadpool_limits  # a run from the store needs none of it

        # Looked for each time, in 2 ms: between two episodes tests have their threads back, and may load libraries.
        self._stack.enter_context(threadpool_limits(limits=1))
        for name, getter, setter in _LIBRARIES:
            library = sys.modules.get(name)
            threads = 1 if library is None else getattr(library, getter)()
            if threads != 1:
                getattr(library, setter)(1)
                self._stack.callback(getattr(library, setter), threads)
