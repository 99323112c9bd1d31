from __future__ import annotations

import functools
import subprocess
import sys

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pytest_drive_robust.runner.cache_key.canonical_text import SESSION, canonical_text, code_of


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


def test_code_that_cannot_be_known_is_of_this_session_only():
    space: dict[str, object] = {}
    exec("class Typed:\n    pass", space)
    held = Handle()
    for unknown in (space["Typed"], Factory(iter(())), lambda: held, functools.partial(Factory, held)):
        assert SESSION in code_of(unknown)


def test_the_workers_of_a_run_share_what_stands_for_unknown_code():
    program = "from pytest_drive_robust.runner.cache_key.canonical_text import SESSION; print(SESSION)"
    told = [
        subprocess.run(
            [sys.executable, "-c", program], capture_output=True, text=True, check=True, env=environment
        ).stdout.strip()
        for environment in ({"PYTEST_XDIST_TESTRUNUID": "abc"}, {"PYTEST_XDIST_TESTRUNUID": "abc"}, {})
    ]
    assert told[0] == told[1] == "abc" != told[2]


class Factory:
    """An agent's factory with a state."""

    def __init__(self, gain: object = 1.0) -> None:
        self.gain = gain

    def __call__(self) -> object:
        return self

    def make(self) -> object:
        return self


class Handle:
    """Something of the operating system."""

    __slots__ = ()
