"""Which agents of a run are driven in lockstep, and the question to each of them whether it may be."""

from __future__ import annotations

import threading
import typing
from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.runner.lockstep.batch import ROWS
from pytest_drive_robust.runner.lockstep.batch_check import check_lockstep, record
from pytest_drive_robust.runner.lockstep.lockstep import WIDTH

if TYPE_CHECKING:
    from pytest_drive_robust.domain.agent import Agent
    from pytest_drive_robust.registry.registry import Registry
    from pytest_drive_robust.runner.episode.loop import Watch
    from pytest_drive_robust.runner.plan import EpisodeRequest
    from pytest_drive_robust.simulators.base import Simulator

__all__ = ["Admission", "Admissions", "admission_of", "factory_offers_lockstep"]


class Admission(NamedTuple):
    """`recorded`: something was seen to ask about. `problem`: why the agent must not be driven in lockstep."""

    recorded: bool
    problem: str | None = None


class Admissions:
    """What is known of the agents of a run, each asked once for all threads."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._known: dict[str, Admission] = {}

    def may_share(self, agent: str, ask: Callable[[], Admission]) -> bool:
        """Return whether the agent may be driven in lockstep; `ask` where that is not known yet. False: still unknown.

        Raises `UsageError` for an agent that is refused, and what `ask` does.
        """
        with self._lock:
            admission = self._known.get(agent) or ask()
            if admission.recorded:
                self._known[agent] = admission
        if admission.problem is not None:
            raise UsageError(
                f"the agent {agent!r} cannot be driven in lockstep: {admission.problem} Leave out --drive-lockstep "
                "(drive_lockstep) and its episodes are driven one by one."
            )
        return admission.recorded


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


def admission_of(
    world: Simulator,
    make_agent: Callable[[], Agent],
    request: EpisodeRequest,
    *,
    width: int,
    watch: Watch | None = None,
) -> Admission:
    """Drive the beginning of `request` by `act`, then ask `act_batch` about it in batches of several widths."""
    recording = record(world, make_agent(), request, watch=watch)
    if recording is None:
        return Admission(recorded=False)
    widths = sorted({ROWS, WIDTH, 2 * WIDTH, width})
    return Admission(recorded=True, problem=check_lockstep(make_agent, [recording], widths, watch=watch))
