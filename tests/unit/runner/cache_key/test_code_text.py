from __future__ import annotations

import functools
import inspect
import subprocess
import sys

import pytest

from pytest_drive_robust.runner.cache_key.code_text import SESSION, code_of

TAKEN = """
import functools

def of_attribute(gain):
    class Local:
        strength = gain
    return Local

def of_private_attribute(gain):
    class Local:
        _strength = gain
    return Local

def of_default(gain):
    class Local:
        def act(self, strength=gain):
            return strength
    return Local

def of_property(gain):
    class Local:
        @property
        def strength(self):
            return gain
    return Local

def of_base(gain):
    class Local(of_attribute(gain)):
        pass
    return Local

def of_wrapper(gain):
    @functools.wraps(of_attribute)
    def make():
        return of_attribute(gain)
    return make

def of_each_of_two(gain):
    def early():
        return late
    found = [early]
    if not gain:
        late = gain
    return lambda: (found, gain)

def of_keyword(gain):
    return lambda *, strength=gain: strength
"""


@pytest.mark.parametrize(
    "maker",
    [
        *("of_attribute", "of_private_attribute", "of_default", "of_property", "of_base", "of_wrapper"),
        *("of_keyword", "of_each_of_two"),
    ],
)
def test_what_a_class_or_function_took_from_the_function_around_it_counts(module, maker):
    make = getattr(module("taking", TAKEN), maker)
    assert code_of(make(1.0)) == code_of(make(1.0)) != code_of(make(2.0))
    assert SESSION not in code_of(make(1.0))


HOLDING = """
import random

def hold(*values):
    return lambda: values

class Handle:
    __slots__ = ()

class Random(random.Random):
    pass

class FailedError(Exception):
    pass

class WithSlot:
    __slots__ = ("gain",)

class Slotted(WithSlot):
    def __init__(self, gain):
        self.gain = gain
"""


def test_code_that_cannot_be_known_is_of_this_session_only(module):
    made, space, around = module("holding", HOLDING), {}, []
    exec("class Typed:\n    pass", space)
    around.append(around)
    held = (iter(()), made.Handle(), made.Random(1), made.FailedError("by 5"), around)
    for unknown in (space["Typed"], *map(made.hold, held), functools.partial(made.hold, held[1])):
        assert SESSION in code_of(unknown)


def test_values_in_slots_count(module):
    made = module("holding", HOLDING)
    assert code_of(made.Slotted(1.0)) == code_of(made.Slotted(1.0)) != code_of(made.Slotted(2.0))


def test_the_weights_of_a_network_that_a_factory_holds_are_not_taken_for_others(module):
    torch = pytest.importorskip("torch")
    assert SESSION in code_of(module("holding", HOLDING).hold(torch.zeros(1)))


CLASSES = (
    "from dataclasses import dataclass\nfrom enum import Enum\nfrom typing import NamedTuple\n"
    "class Brake:\n    def press(self): return 1.0\n"
    "@dataclass\nclass Values(Brake):\n    gain: float = 1.0\n"
    "class Mode(Brake, Enum):\n    SOFT = 'soft'\n"
    "class Pair(NamedTuple):\n    gain: float = 1.0\n    def press(self): return 1.0\n"
    "class Table(dict): pass\n"
)


@pytest.mark.parametrize("value", ["Values()", "Mode.SOFT", "Pair()", "Table()", "Brake()"])
def test_what_the_values_of_a_factory_do_counts(module, value):
    def code_with(pressed):
        hold = module("holding", HOLDING).hold
        made = module("braking", CLASSES.replace("return 1.0", f"return {pressed}"))
        return code_of(hold(eval(value, vars(made))))

    assert code_with(1.0) == code_with(1.0) != code_with(2.0)
    assert SESSION not in code_with(1.0)


def test_what_a_class_was_derived_from_counts_where_its_own_module_does_not_import_it(module):
    text = "def braking(agent):\n    class Braking(agent):\n        def act(self): return 0\n    return Braking\n"

    def code_with(gain):
        made = module("deriving", text)
        return code_of(made.braking(module("derived_from", f"class Agent:\n    gain = {gain}\n").Agent))

    assert code_with(1.0) == code_with(1.0) != code_with(2.0)


def test_what_a_function_does_around_the_one_that_it_wraps_counts(module):
    text = (
        "import functools\nfrom inside import Agent\n@functools.wraps(Agent)\n"
        "def make():\n    agent = Agent()\n    agent.gain = 1.0\n    return agent\n"
    )

    def code_with(gain, inner):
        module("inside", f"class Agent:\n    gain = {inner}\n")
        return code_of(module("outside", text.replace("1.0", gain)).make)

    codes = [code_with(*gains) for gains in (("1.0", "1.0"), ("2.0", "1.0"), ("1.0", "2.0"), ("1.0", "1.0"))]
    assert codes[0] == codes[3]
    assert len(set(codes)) == 3


def test_what_a_library_wraps_is_what_it_wraps(module):
    text = "import contextlib\n@contextlib.contextmanager\ndef make():\n    yield None\n"
    make = module("managing", text).make
    assert code_of(make) == code_of(inspect.unwrap(make))


def test_the_workers_of_a_run_share_what_stands_for_unknown_code():
    program = "from pytest_drive_robust.runner.cache_key.code_text import SESSION; print(SESSION)"
    told = [
        subprocess.run(
            [sys.executable, "-c", program], capture_output=True, text=True, check=True, env=environment
        ).stdout.strip()
        for environment in ({"PYTEST_XDIST_TESTRUNUID": "abc"}, {"PYTEST_XDIST_TESTRUNUID": "abc"}, {})
    ]
    assert told[0] == told[1] == "abc" != told[2]
