"""Whether an agent says that many of its episodes may be driven at once, before there is an agent."""

from __future__ import annotations

import typing
from contextlib import suppress

from pytest_drive_robust.domain.agent import offers_lockstep
from pytest_drive_robust.registry.registry import Registry


def factory_offers_lockstep(agent: str, registry: Registry) -> bool:
    """Return whether what makes the agent has an `act_batch`, or says that it returns a class that has one.

    No agent is made: that belongs in the process that drives it. Raises `UnknownNameError` or `PluginError`.
    """
    factory = registry.entry("agents", agent).load()
    made = None
    with suppress(Exception):  # an annotation that names something imported for type checkers only, or no function
        made = typing.get_type_hints(factory).get("return")
    return offers_lockstep(factory) or offers_lockstep(made)
