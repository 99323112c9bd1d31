"""The agent as a worker drives it: every control is kept, nothing that it raises gets past the episode loop."""

from __future__ import annotations

import contextlib
import os
import traceback
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, TypeVar

from pytest_drive_robust.domain.agent import Agent, consumed_signals, is_privileged
from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.observation import CameraSpec, Observation
from pytest_drive_robust.domain.route import GlobalPlan
from pytest_drive_robust.engine.shared_state import SharedState
from pytest_drive_robust.runner.episode.stored_controls import AgentRig

__all__ = ["CUT_OFF", "WatchedAgent"]

CUT_OFF = 71
"""The exit code of a worker that can no longer answer, because its agent closed the connection."""
T = TypeVar("T")


class WatchedAgent:
    """Passes every call on to `agent` and writes to the shared state what salvaging its episode would take.

    A KeyboardInterrupt that comes out of it is the agent's own doing (no terminal reaches a worker), and so is what
    pytest raises: both become ordinary exceptions of the same name, which the loop blames on the agent.
    """

    def __init__(self, agent: Agent, state: SharedState, descriptor: int) -> None:
        self._agent = agent
        self._state = state
        self._descriptor = descriptor
        self._inode = os.fstat(descriptor).st_ino
        self._cameras: Sequence[CameraSpec] | None = None

    def __getattr__(self, name: str) -> Any:
        found = getattr(self._agent, name)  # `consumes`, `privileged` and `plan`, where the agent has them
        return partial(_contained, found) if name == "plan" and callable(found) else found

    def sensors(self) -> Sequence[CameraSpec]:
        """Return the agent's cameras: it drives an episode of its own."""
        self._cameras = _contained(self._agent.sensors)
        return self._cameras

    def reset(self, route: GlobalPlan, seed: int) -> None:
        """Keep the rig, which the loop has checked by now, and reset the agent.

        One that stands in for others in a batch is not asked for its cameras, and leaves the rig as it is.
        """
        if self._cameras is not None:
            consumes = tuple(sorted(consumed_signals(self._agent)))
            self._state.equip(AgentRig(tuple(self._cameras), consumes, is_privileged(self._agent)))
            self._cameras = None
        _contained(self._agent.reset, route, seed)

    def act(self, observation: Observation) -> Control:
        """Return the agent's control and keep it."""
        self._state.asked = control = _contained(self._agent.act, observation)
        self._check_connection()
        return control

    def act_batch(self, rows: Sequence[WatchedAgent], observations: Sequence[Observation]) -> Sequence[Control]:
        """Return the agents' own answers. The first is kept: that of an episode which is driven alone."""
        agents: list[Any] = [row._agent for row in rows]
        answers: Sequence[Control] = _contained(agents[0].act_batch, agents, observations)
        self._check_connection()
        self._state.asked = answers[0] if isinstance(answers, Sequence) and answers else None
        return answers

    def _check_connection(self) -> None:
        """End the process when the connection is closed, at once, so that it always ends in the same tick."""
        try:
            lost = os.fstat(self._descriptor).st_ino != self._inode
        except OSError:
            lost = True
        if lost:
            os._exit(CUT_OFF)


def _contained(function: Callable[..., T], *arguments: object) -> T:
    """Return what the function returns; whatever it raises is an `Exception` or a `SystemExit`.

    The whole traceback is printed, among what the agent printed: a result holds one line of it.
    """
    try:
        return function(*arguments)
    except BaseException as error:
        with contextlib.suppress(Exception):  # the agent may have closed what it goes to
            traceback.print_exception(error)
        if isinstance(error, (Exception, SystemExit)):
            raise
        kind = type(error)
        twin: type[Exception] = type(kind.__name__, (Exception,), {"__module__": kind.__module__})
        raise twin(str(error)).with_traceback(error.__traceback__) from None
