"""`compat="highway-env"`: exactly what highway-env's `Road.act()` and `Road.step(dt)` do, in compiled kernels.

It serves agents that were trained on highway-env. On one machine the results are the same bits; `CompatRoad.exact` says
whether this machine's numpy could be matched (otherwise they agree to about 1e-9).

Where is what: `road` is the door; `known` says which classes we port and refuses the others; `network` and `vehicles`
turn highway-env's objects into the arrays of `columns` and back, `reading` all of them at once; `arithmetic` computes
as numpy does on this machine, by numpy's own `loops`; `lanes`, `graph`, `drivers`, `bicycle` and `contact` are parts of
the kernels, `advance` is one tick of them, and `told` is what a policy may say before it; `compiled` says how they are
compiled, and when to delete the results.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pytest_drive_robust.simulators.compat.road import CompatRoad

__all__ = ["CompatRoad"]


def __getattr__(name: str) -> object:
    # lazily: names are listed at collection, when nobody may import numba yet
    if name == "CompatRoad":
        from pytest_drive_robust.simulators.compat.road import CompatRoad

        return CompatRoad
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
