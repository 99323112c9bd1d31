from __future__ import annotations

import functools
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

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


@dataclass
class Metres:
    value: float = 1.0


@dataclass
class Seconds:
    value: float = 1.0


def test_values_of_different_kinds_have_different_text():
    values = [b"ab", "ab", "6162", Path("ab"), [1, 2], {1, 2}, {1: 2}, 1.0, "1", Metres(), Seconds(), Metres(2.0), None]
    assert len({canonical_text(value) for value in values}) == len(values)


def test_the_order_in_which_a_set_was_filled_does_not_count():
    up, down = [0, 8, 16], [16, 8, 0]  # they share a place, so their set keeps them in the order in which they came
    one, other = set(up), set(down)
    assert canonical_text(one) == canonical_text(other) == canonical_text(frozenset(one))


def test_what_a_class_or_function_took_from_the_function_around_it_counts():
    def of_attribute(gain):
        class Local:
            strength = gain

        return Local

    def of_default(gain):
        class Local:
            def act(self, strength=gain):
                return strength

        return Local

    for make in (of_attribute, of_default, lambda gain: lambda *, strength=gain: strength):
        assert code_of(make(1.0)) == code_of(make(1.0)) != code_of(make(2.0))


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
