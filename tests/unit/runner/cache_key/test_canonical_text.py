from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pytest_drive_robust.runner.cache_key.canonical_text import canonical_text


@given(
    st.recursive(
        st.none() | st.booleans() | st.integers() | st.text(), lambda inner: st.lists(inner) | st.tuples(inner)
    )
)
def test_equal_values_have_equal_text(value):
    import copy

    assert canonical_text(copy.deepcopy(value)) == canonical_text(value)


@given(st.floats(), st.floats())
def test_different_numbers_have_different_text(one, other):
    same = one == other or (one != one and other != other)
    assert (canonical_text(one) == canonical_text(other)) is same


def test_the_order_of_a_mapping_does_not_count():
    assert canonical_text({"a": 1, "b": 2}) == canonical_text({"b": 2, "a": 1})
    assert canonical_text({"1": 1}) != canonical_text({1: 1})


def test_an_object_has_no_text():
    with pytest.raises(TypeError, match="object has no content"):
        canonical_text([object()])
