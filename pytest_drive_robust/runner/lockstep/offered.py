"""Finds out, before an agent is made, whether its episodes may be driven in lockstep."""

from __future__ import annotations

import typing
from contextlib import suppress

from pytest_drive_robust.domain.agent import offers_lockstep
from pytest_drive_robust.registry.registry import Registry


def factory_offers_lockstep(agent: str, registry: Registry) -> bool:
    """Return whether the agent's factory has an `act_batch`, or its return annotation is a class that has one.

    No agent is made here: only the process that drives an agent makes it. Raises `UnknownNameError` or `PluginError`.
    """
    factory = registry.entry("agents", agent).load()
    made = None
    with suppress(Exception):  # an annotation that names something imported for type checkers only, or no function
        made = typing.get_type_hints(factory).get("return")
    return offers_lockstep(factory) or offers_lockstep(made)
