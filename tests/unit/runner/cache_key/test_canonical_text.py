from __future__ import annotations

from dataclasses import InitVar, dataclass
from pathlib import Path

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


@dataclass
class Metres:
    value: float = 1.0


@dataclass
class Seconds:
    value: float = 1.0


@dataclass
class Kilometres:
    given_m: InitVar[float]
    value: float = 0.0

    def __post_init__(self, given_m):
        self.value = given_m / 1000


def test_what_a_dataclass_is_only_made_from_counts_by_what_it_became():
    assert canonical_text(Kilometres(500.0)) == '{"Kilometres":[["value",0.5]]}'


def test_values_of_different_kinds_have_different_text():
    values = [
        b"ab",
        "ab",
        "6162",
        Path("ab"),
        Path("c/ab"),
        [1, 2],
        {1, 2},
        {1: 2},
        1.0,
        "1",
        "nan",
        float("nan"),
        None,
    ]
    values += [Metres(), Seconds(), Metres(2.0)]
    assert len({canonical_text(value) for value in values}) == len(values)


def test_the_order_in_which_a_set_was_filled_does_not_count():
    up, down = [0, 8, 16], [16, 8, 0]  # they share a place, so their set keeps them in the order in which they came
    one, other = set(up), set(down)
    assert canonical_text(one) == canonical_text(other) == canonical_text(frozenset(one))


def test_an_object_has_no_text():
    with pytest.raises(TypeError, match="object has no content"):
        canonical_text([object()])
