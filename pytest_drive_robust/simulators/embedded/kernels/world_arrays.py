"""A world that compiled code holds on to: numba unwraps one reference in each call instead of some forty arrays.

Unwrapping the tuples of arrays takes longer than many a tick; unwrapping a reference takes a tenth of a microsecond.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from numba import types
from numba.experimental import structref

if TYPE_CHECKING:
    from pytest_drive_robust.simulators.embedded.state import State, Statics

__all__ = ["WorldArrays", "world_arrays"]


@structref.register
class WorldArraysType(types.StructRef):
    """Numba's type of `WorldArrays`."""


class WorldArrays(structref.StructRefProxy):
    """Two tuples of arrays; made by the entry point `pack_world`, and the arrays stay those that Python sees.

    The attributes are for compiled code.
    """

    statics: Statics
    state: State


_define: Callable[..., None] = structref.define_proxy
_define(WorldArrays, WorldArraysType, ["statics", "state"])

world_arrays: Callable[[Statics, State], WorldArrays] = WorldArrays
"""Makes one, in compiled code."""
