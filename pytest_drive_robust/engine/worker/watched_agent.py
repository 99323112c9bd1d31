"""The agent as a child process drives it: every control is remembered, nothing that it raises gets past the loop."""

from __future__ import annotations

import contextlib
import os
import traceback
from collections.abc import Callable, Sequence
from typing import Any, TypeVar

from pytest_drive_robust.domain.agent import Agent, consumed_signals, is_privileged
from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.observation import CameraSpec, Observation
from pytest_drive_robust.domain.route import GlobalPlan
from pytest_drive_robust.domain.truth import WorldState
from pytest_drive_robust.engine.shared_state import SharedState
from pytest_drive_robust.runner.episode.rescore import AgentRig

__all__ = ["CUT_OFF", "WatchedAgent", "tamed"]

CUT_OFF = 71
"""The exit code of a child that can no longer answer, because its agent closed the channel."""
T = TypeVar("T")


class WatchedAgent:
    """Passes every call on to `agent` and writes to the board what salvaging its episode would take.

    A KeyboardInterrupt that comes out of it is the agent's own doing (no terminal reaches a child), and so is what
    pytest raises: both become ordinary exceptions of the same name, which the loop blames on the agent.
    """

    def __init__(self, agent: Agent, board: SharedState, channel: int) -> None:
        self._agent = agent
        self._board = board
        self._channel = channel
        self._inode = os.fstat(channel).st_ino
        self._cameras: tuple[CameraSpec, ...] = ()
        self._asked: Control | None = None

    def __getattr__(self, name: str) -> Any:
        return getattr(self._agent, name)  # `consumes` and `privileged`, where the agent has them

    def sensors(self) -> Sequence[CameraSpec]:
        """The agent's cameras."""
        cameras: Any = tamed(self._agent.sensors)
        self._cameras = cameras
        return self._cameras

    def reset(self, route: GlobalPlan, seed: int) -> None:
        """The loop has checked the rig by now: keep it, then wake the agent."""
        consumes = tuple(sorted(consumed_signals(self._agent)))
        self._board.equip(AgentRig(tuple(self._cameras), consumes, is_privileged(self._agent)))
        tamed(self._agent.reset, route, seed)

    def act(self, observation: Observation) -> Control:
        """The agent's control, remembered."""
        try:  # spelled out, not `tamed`: this is called in every tick
            self._asked = control = self._agent.act(observation)
        except (Exception, SystemExit) as error:
            _print(error)
            raise
        except BaseException as error:
            _print(error)
            raise _twin(error).with_traceback(error.__traceback__) from None
        self._check_channel()
        return control

    def ticked(self, tick: int, frame: WorldState, observation: Observation, applied: Control) -> None:
        """A tick was driven (see `on_tick` of `runner.episode.loop.drive_episode`)."""
        self._board.add(tick, self._asked, applied, frame.ego)
        self._asked = None

    def _check_channel(self) -> None:
        """End at once when nobody would hear the end of the episode, so that it always ends in the same tick."""
        try:
            lost = os.fstat(self._channel).st_ino != self._inode
        except OSError:
            lost = True
        if lost:
            os._exit(CUT_OFF)


def tamed(function: Callable[..., T], *arguments: object) -> T:
    """What the function returns; whatever it raises is an `Exception` or a `SystemExit`."""
    try:
        return function(*arguments)
    except (Exception, SystemExit) as error:
        _print(error)
        raise
    except BaseException as error:
        _print(error)
        raise _twin(error).with_traceback(error.__traceback__) from None


def _print(error: BaseException) -> None:
    """The whole traceback, among what the agent printed: a result holds one line of it."""
    with contextlib.suppress(Exception):  # the agent may have closed what it goes to
        traceback.print_exception(error)


def _twin(error: BaseException) -> Exception:
    """An `Exception` that looks like `error` in a message."""
    kind = type(error)
    twin: type[Exception] = type(kind.__name__, (Exception,), {"__module__": kind.__module__})
    return twin(str(error))
