"""One reference to a world's arrays, which kernels pass to each other instead of some forty arrays.

Unwrapping the tuples of arrays takes longer than many a tick, and each function that took these tuples would be
compiled for some three hundred arguments. The fields of `Statics` and `State` are attributes of the reference. In
compiled code an array taken from the reference is borrowed: it counts no references and must not outlive the call.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from numba import types
from numba.core import cgutils
from numba.core.typing.templates import AttributeTemplate
from numba.experimental import structref
from numba.extending import infer_getattr, lower_getattr

from pytest_drive_robust.jit.signatures import numba_type
from pytest_drive_robust.simulators.embedded.state import State, Statics


@structref.register
class WorldArraysType(types.StructRef):  # type: ignore[misc]
    """Numba's type of `WorldArrays`."""


class _Reference(structref.StructRefProxy):  # type: ignore[misc]
    """Python's handle of a world, made by the entry point `pack_world`; shares its arrays with Python."""

    @classmethod
    def numba_type(cls) -> Any:
        """Return numba's type of this class."""
        return WorldArraysType([("statics", numba_type(Statics)), ("state", numba_type(State))])


if TYPE_CHECKING:

    class WorldArrays(Statics, State):  # type: ignore[misc]
        """The fields of `Statics` and `State`, as compiled code sees them."""

else:
    WorldArrays = _Reference

_define: Callable[..., None] = structref.define_proxy
_define(_Reference, WorldArraysType, ["statics", "state"])

world_arrays: Callable[[Statics, State], WorldArrays] = _Reference
"""Make a `WorldArrays` in compiled code."""


@infer_getattr
class _Fields(AttributeTemplate):  # type: ignore[misc]
    """Give the fields of `Statics` and `State` a numba type as attributes."""

    key = WorldArraysType

    def generic_resolve(self, world: Any, name: str) -> Any:
        """Return the numba type of a field, or None for an unknown name."""
        for part in world.field_dict.values():
            if name in part.fields:
                return part[part.fields.index(name)]
        return None


def _reads(part: str, name: str, index: int) -> None:
    """Make numba read one field without touching the other fields."""

    @lower_getattr(WorldArraysType, name)
    def read(context: Any, builder: Any, world: Any, value: Any) -> Any:
        payload = structref._Utils(context, builder, world).get_data_pointer(value)
        parts = list(world.field_dict)
        field = world.field_dict[part][index]
        place = cgutils.gep_inbounds(builder, payload, 0, parts.index(part), index)
        loaded = context.data_model_manager[field].load_from_data_pointer(builder, place)
        if not isinstance(field, types.Array):
            return loaded
        array = context.make_array(field)(context, builder, value=loaded)
        array.meminfo = cgutils.get_null_value(array.meminfo.type)
        return array._getvalue()


for _part, _fields in (("statics", Statics._fields), ("state", State._fields)):
    for _index, _name in enumerate(_fields):
        _reads(_part, _name, _index)
