"""What is remembered is the answer that numba gave, and only kernels are compiled with it."""

from __future__ import annotations

import operator

import numba
import pytest
from numba.core.registry import cpu_target
from numba.core.types.functions import BaseFunction

from pytest_drive_robust.jit.resolutions import remembered_resolutions

ADD = (operator.add, (numba.types.float64, numba.types.float64))
GET = (operator.getitem, (numba.types.Array(numba.types.float64, 1, "C"), numba.types.intp))


@pytest.mark.parametrize(("called", "types"), [ADD, GET], ids=["add", "getitem"])
def test_the_second_answer_is_the_first(called: object, types: tuple[object, ...]) -> None:
    context = cpu_target.typing_context
    context.refresh()
    function = context.resolve_value_type(called)
    plain = function.get_call_type(context, types, {})
    with remembered_resolutions():
        first = function.get_call_type(context, types, {})
        key = function.get_impl_key(first)
        function._impl_keys.clear()
        second = function.get_call_type(context, types, {})
    assert plain == first == second
    assert function.get_impl_key(second) == key


def test_numba_is_as_it_was_afterwards() -> None:
    before = BaseFunction.get_call_type
    with remembered_resolutions(), remembered_resolutions():
        assert BaseFunction.get_call_type is not before
    assert BaseFunction.get_call_type is before
