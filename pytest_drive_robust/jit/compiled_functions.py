"""Count our functions as numba compiles them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from numba.core import event

Tell = Callable[[int, int], None]
"""Called with the number of functions compiled so far and in all."""


class CompiledFunctions(event.Listener):  # type: ignore[misc]
    """Calls `finished` once for each of our functions when it is compiled."""

    def __init__(self, finished: Callable[[], object]) -> None:
        self._finished = finished
        self._seen: set[int] = set()

    def watch(self) -> None:
        """Begin to count."""
        event.register("numba:compile", self)

    def unwatch(self) -> None:
        """Stop counting."""
        event.unregister("numba:compile", self)

    def on_start(self, event: Any) -> None:
        """Do nothing."""

    def on_end(self, event: Any) -> None:
        """Count a function that was compiled for the first time; those of numba itself are not counted."""
        kernel = event.data["dispatcher"]
        module = str(kernel.py_func.__module__)
        if id(kernel) not in self._seen and not module.startswith("numba.") and module != "None":
            self._seen.add(id(kernel))
            self._finished()


@contextmanager
def counted(tell: Tell, total: int) -> Iterator[None]:
    """Call `tell(done, total)` for each of `total` functions that is compiled within this context, and at its ends."""
    done = 0

    def finished() -> None:
        nonlocal done
        done += 1
        tell(min(done, total), total)

    tell(0, total)
    listener = CompiledFunctions(finished)
    listener.watch()
    try:
        yield
    finally:
        listener.unwatch()
    tell(total, total)
