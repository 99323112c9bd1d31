"""The default simulator: our own 20 Hz world in arrays.

Where is what: `towns` draws maps, `map` compiles them and finds the ways through their junctions; `dense_route` lays a
route on its town (`matching` finds its lanes); `scenarios` puts actors on the `stage`; `state` names the arrays,
`kernels` moves them, `criteria` judges; `sensors` and `camera` show them to the agent; `routes` reads and writes route
files, `generate` draws new ones.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pytest_drive_robust.simulators.embedded.simulator import EmbeddedSimulator

__all__ = ["EmbeddedSimulator"]


def __getattr__(name: str) -> object:
    # lazily: `routes` is read at collection, when nobody may import numba yet
    if name == "EmbeddedSimulator":
        from pytest_drive_robust.simulators.embedded.simulator import EmbeddedSimulator

        return EmbeddedSimulator
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
