"""What a record says about libraries and the machine: what decides its bits, and nothing where nothing does."""

from __future__ import annotations

import re
import sys
from types import SimpleNamespace
from typing import Any

import pytest
from result_factory import make_result

from pytest_drive_robust.registry.registry import default_registry
from pytest_drive_robust.runner.episode.machine import machine_facts, with_machine

EMBEDDED = SimpleNamespace(portable_bits=True)
"""All that is asked of a world."""
ANY_CODE = {"machine libm", "machine numpy"}


class Plain:
    """Promises nothing."""


class Portable:
    portable_bits = True


class OnNumpy:
    computed_by = ("numpy",)


def test_the_machine_counts_unless_the_agent_promises_that_it_does_not() -> None:
    assert machine_facts(Portable(), EMBEDDED) == {}
    told = machine_facts(Plain(), EMBEDDED)
    assert set(told) == ANY_CODE
    assert all(re.fullmatch("[0-9a-f]{12}", digest) for digest in told.values())
    assert set(machine_facts(OnNumpy(), EMBEDDED)) == {"machine numpy"}


def test_a_world_that_promises_nothing_computes_with_the_machine() -> None:
    assert set(machine_facts(Portable(), SimpleNamespace())) == ANY_CODE
    assert machine_facts(OnNumpy(), SimpleNamespace()) == machine_facts(Plain(), EMBEDDED)


@pytest.mark.parametrize("name", ["blind", "blind:speed=4", "classical", "constant", "expert", "random", "reactive"])
def test_the_records_of_agents_without_a_network_depend_on_nothing(name: str) -> None:
    registry = default_registry()
    result = make_result(versions={"simulator": "embedded 2"})
    assert with_machine(result, registry.agent(name), registry.simulator("embedded")).versions == result.versions


def test_records_tell_the_versions_that_the_keys_hold() -> None:
    python = f"{sys.version_info[0]}.{sys.version_info[1]}"
    told = with_machine(make_result(versions={"simulator": "embedded 2"}), OnNumpy(), EMBEDDED).versions  # type: ignore[arg-type]
    assert set(told) == {"python", "numpy", "simulator", "machine numpy"}
    assert told["python"] == python
    everything = with_machine(make_result(versions={}), Plain(), EMBEDDED).versions  # type: ignore[arg-type]
    assert {"python", "pytest", *ANY_CODE} <= set(everything)


@pytest.mark.parametrize(("engine", "module"), [("torch", "torch"), ("onnx", "onnxruntime")])
def test_learned_agents_depend_on_what_computes_their_networks(engine: str, module: str) -> None:
    pytest.importorskip(module)
    made: Any = default_registry().entry("agents", "tcp").load()
    told = with_machine(make_result(versions={}), made(engine=engine), EMBEDDED).versions  # type: ignore[arg-type]
    assert set(told) == {"python", "numpy", module, f"machine {module}", "machine numpy"}
