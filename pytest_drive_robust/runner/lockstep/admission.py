"""Which agents of a run are driven in lockstep: those that say that they can, and pass when they are asked."""

from __future__ import annotations

import threading
import typing
from collections.abc import Callable
from typing import TYPE_CHECKING

from pytest_drive_robust.errors import UsageError

if TYPE_CHECKING:
    from pytest_drive_robust.registry.registry import Registry

__all__ = ["Admissions", "factory_offers_lockstep"]


class Admissions:
    """What is known of the agents of a run, each asked once for all threads."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._known: dict[str, UsageError | None] = {}

    def may_share(self, agent: str, check: Callable[[], bool]) -> bool:
        """Return whether the agent may be driven in lockstep, False when that is still unknown.

        `check` finds out what is not known yet (see `BatchDriver.check`). Raises `UsageError` for one that it refused.
        """
        with self._lock:
            if agent not in self._known:
                try:
                    if not check():
                        return False
                    self._known[agent] = None
                except UsageError as error:
                    self._known[agent] = error
            refused = self._known[agent]
        if refused is not None:
            raise refused
        return True


def factory_offers_lockstep(agent: str, registry: Registry) -> bool:
    """Return whether what makes the agent has an `act_batch`, or says that it returns a class that has one.

    No agent is made: that belongs in the process that drives it. Raises `UnknownNameError` or `PluginError`.
    """
    factory = registry.entry("agents", agent).load()
    if callable(getattr(factory, "act_batch", None)):
        return True
    try:
        made = typing.get_type_hints(factory).get("return")
    except Exception:  # an annotation that names something imported for type checkers only, or no function at all
        return False
    return callable(getattr(made, "act_batch", None))
