"""What a record says about the machine: nothing where it decides nothing."""

from __future__ import annotations

import re

import pytest

from pytest_drive_robust.domain.result import ANY_MACHINE
from pytest_drive_robust.registry.registry import default_registry
from pytest_drive_robust.runner.episode.machine import machine_facts


class Plain:
    """Promises nothing."""


class Portable:
    portable_bits = True


def test_the_machine_counts_unless_the_agent_promises_that_it_does_not() -> None:
    assert machine_facts(Portable()) == {"machine": ANY_MACHINE}
    told = machine_facts(Plain())
    assert re.fullmatch("[0-9a-f]{12}", told["machine"])
    assert machine_facts(None) == told


@pytest.mark.parametrize("name", ["blind", "blind:speed=4", "classical", "constant", "expert", "random", "reactive"])
def test_the_agents_without_a_network_promise_it(name: str) -> None:
    assert machine_facts(default_registry().agent(name)) == {"machine": ANY_MACHINE}
